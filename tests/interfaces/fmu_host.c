/* A plain C program that loads the library of an FMU and runs it: on, then off, in steps of 1 ms.
 * usage: fmu_host LIBRARY TOKEN; prints time, position, tail angle, current and charge, then what wrong input gives. */
#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

typedef void *(*Instantiate)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t,
                             void *, void (*)(void *, int, const char *, const char *), void *);
typedef int (*Enter)(void *, bool, double, double, bool, double);
typedef int (*Plain)(void *);
typedef int (*Step)(void *, double, double, bool, bool *, bool *, bool *, double *);
typedef int (*GetFloat)(void *, const uint32_t *, size_t, double *, size_t);
typedef int (*SetFloat)(void *, const uint32_t *, size_t, const double *, size_t);
typedef int (*SetBool)(void *, const uint32_t *, size_t, const bool *, size_t);

static void say(void *environment, int status, const char *category, const char *message) {
    (void)environment, (void)category;
    printf("%d: %s\n", status, message);
}

int main(int count, char **words) {
    if (count != 3) return 2;
    void *library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 3;
    Instantiate instantiate = (Instantiate)dlsym(library, "fmi3InstantiateCoSimulation");
    Enter enter = (Enter)dlsym(library, "fmi3EnterInitializationMode");
    Plain leave = (Plain)dlsym(library, "fmi3ExitInitializationMode");
    Step step = (Step)dlsym(library, "fmi3DoStep");
    GetFloat get = (GetFloat)dlsym(library, "fmi3GetFloat64");
    SetFloat set = (SetFloat)dlsym(library, "fmi3SetFloat64");
    SetBool set_bool = (SetBool)dlsym(library, "fmi3SetBoolean");
    Plain free_instance = (Plain)dlsym(library, "fmi3FreeInstance");
    void *robot = instantiate("robot", words[2], NULL, false, false, false, false, NULL, 0, NULL, say, NULL);
    if (!robot || enter(robot, false, 0.0, 0.0, false, 0.0) || leave(robot)) return 4;
    const uint32_t remote = 1, duty = 2, asked[5] = {0, 10, 11, 18, 13};
    bool on = false, event, end, early;
    double last = 0.0, values[5];
    for (int n = 0; n < 200; n++) {
        if (n == 100 && set_bool(robot, &remote, 1, &on, 1)) return 5;
        if (step(robot, 1e-3 * n, 1e-3, true, &event, &end, &early, &last)) return 6;
    }
    if (get(robot, asked, 5, values, 5)) return 7;
    printf("%.17g %.17g %.17g %.17g %.17g\n", values[0], values[1], values[2], values[3], values[4]);
    double wrong = NAN;
    int refused = set(robot, &duty, 1, &wrong, 1);
    refused += step(robot, 0.2, 0.0, true, &event, &end, &early, &last);
    refused += step(robot, 0.7, 1e-3, true, &event, &end, &early, &last);
    refused += instantiate("robot", "another", NULL, false, false, false, false, NULL, 0, NULL, say, NULL) != NULL;
    printf("%d\n", refused);
    free_instance(robot);
    return 0;
}
