/* Colours of a picture as films keep them: 8-bit YUV of Rec. ITU-R BT.709-6 in the limited range. */
#include "core.h"

enum { BITS = 16 }; /* binary digits of fractions: sums are of whole numbers, which become vector instructions */

#define WHOLE(x) ((int32_t)((x) < 0.0 ? (x) - 0.5 : (x) + 0.5))

/* Shares of the colours in the luma, section 3.2; steps of luma and half of chroma for one of a colour, 3.4. */
#define RED 0.2126
#define GREEN 0.7152
#define BLUE 0.0722
#define LUMA (219.0 / 255.0 * (1 << BITS))
#define CHROMA (112.0 / 255.0 * (1 << BITS))

static const int32_t Y[3] = {WHOLE(RED * LUMA), WHOLE(GREEN * LUMA), WHOLE(BLUE * LUMA)};
static const int32_t CB[3]
    = {WHOLE(-RED / (1.0 - BLUE) * CHROMA), WHOLE(-GREEN / (1.0 - BLUE) * CHROMA), WHOLE(CHROMA)};
static const int32_t CR[3] = {WHOLE(CHROMA), WHOLE(-GREEN / (1.0 - RED) * CHROMA), WHOLE(-BLUE / (1.0 - RED) * CHROMA)};

/* Luma without light, and eight times chroma without colour; half a step more, as whole numbers are cut off. */
static const int32_t BLACK = (16 << BITS) + (1 << (BITS - 1)), GREY = (128 << (BITS + 3)) + (1 << (BITS + 2));

/* Eight times a colour, weighted by 1/4, 1/2, 1/4 along two rows; `left` of the first column is the column itself. */
static int32_t blurred(const uint8_t *upper, const uint8_t *lower, int64_t left, int64_t here) {
    return upper[left] + lower[left] + 2 * (upper[here] + lower[here]) + upper[here + 3] + lower[here + 3];
}

/* Luma, and chroma at half the size, of a picture: 8-bit YUV 4:2:0 of BT.709 in the limited range.
 *
 * A sample of chroma lies on an even column between two rows, where H.264 takes it to lie unless told otherwise. It is
 * the mean of the two rows, with weights of 1/4, 1/2, 1/4 along them.
 *
 * image: sRGB bytes; height and width are even; out: bytes, rows = 3 height / 2: luma, then both parts of chroma row by
 * row. */
EXPORT void film_colours(const uint8_t *image /* (height, width, 3) */, uint8_t *out /* (rows, width) */,
                         int64_t height, int64_t width, int64_t rows) {
    const int64_t half = width / 2, parts = rows - height; /* rows of both parts of chroma, (2, height/2, width/2) */
    uint8_t *chroma = out + height * width;
    for (int64_t i = 0; i < height * width; i++) {
        const uint8_t *pixel = image + 3 * i;
        out[i] = (uint8_t)((Y[0] * pixel[0] + Y[1] * pixel[1] + Y[2] * pixel[2] + BLACK) >> BITS);
    }
    for (int64_t i = 0; i < parts; i++) {
        const uint8_t *upper = image + 6 * i * width, *lower = upper + 3 * width;
        uint8_t *blues = chroma + i * half, *reds = blues + parts * half;
        for (int64_t j = 0; j < half; j++) {
            const int64_t here = 6 * j, left = j > 0 ? here - 3 : 0;
            const int32_t red = blurred(upper, lower, left, here), green = blurred(upper, lower, left + 1, here + 1);
            const int32_t blue = blurred(upper, lower, left + 2, here + 2);
            blues[j] = (uint8_t)((CB[0] * red + CB[1] * green + CB[2] * blue + GREY) >> (BITS + 3));
            reds[j] = (uint8_t)((CR[0] * red + CR[1] * green + CR[2] * blue + GREY) >> (BITS + 3));
        }
    }
}
