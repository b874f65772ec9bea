/* What fmi3.c and fmi3_absent.c share: types of the FMI 3.0 standard (fmi-standard.org), and the numbers of an instance. Made by awes. */
#ifndef FMI3_H
#define FMI3_H

#include "fmu.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifndef FMI3_Export
#if defined _WIN32
#define FMI3_Export __declspec(dllexport)
#elif defined __GNUC__
#define FMI3_Export __attribute__((visibility("default")))
#else
#define FMI3_Export
#endif
#endif
#define PASTED_(a, b) a##b
#define PASTED(a, b) PASTED_(a, b)
#ifdef FMI3_FUNCTION_PREFIX
#define FMI(name) PASTED(FMI3_FUNCTION_PREFIX, name)
#else
#define FMI(name) name
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void *fmi3Instance;
typedef uint32_t Reference;
typedef void (*LogMessage)(void *environment, fmi3Status status, const char *category, const char *message);

enum {
    TIME = 0,
    X = 1,
    HELD = X + STATES,
    SP = HELD + SET_POINTS,
    U = SP + SET_POINTS,
    SLOPE = U + INPUTS,
    C = SLOPE + INPUTS,
    DX = C + PARAMETERS,
    Y = DX + STATES,
    TOTAL = Y + OUTPUTS
};
enum { INSTANTIATED, INITIALIZING, RUNNING };

typedef struct {
    double v[TOTAL], next_event;
    int phase;
    bool exchange, fresh;
    void *environment;
    LogMessage log;
} Instance;

static inline fmi3Status failed(const Instance *m, const char *what)
{
    if (m->log)
        m->log(m->environment, fmi3Error, "logStatusError", what);
    return fmi3Error;
}

#endif
