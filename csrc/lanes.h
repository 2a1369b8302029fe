/* Rings, points or nodes that are worked out together, so that the compiler has loops for wide registers.
 *
 * Numbers of theirs are arrays of LANES; where fewer are left, the last one stands in all lanes that are free.
 */
#ifndef SPIRILLUM_LANES_H
#define SPIRILLUM_LANES_H

enum { LANES = 8 };
#define EACH_LANE _Pragma("omp simd") for (int l = 0; l < LANES; l++)

#endif
