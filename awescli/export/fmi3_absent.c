/* Functions of FMI 3.0 for what this model has not: other types of variables, configuration, clocks, derivatives on demand. An
   importer may look for any of them: they say so, and fail. Made by awes. */
#include "fmi3.h"

#define NONE(name, ...) \
    FMI3_Export fmi3Status FMI(name)(fmi3Instance instance, __VA_ARGS__) { return failed((Instance *)instance, #name " is not supported"); }
#define NONE_OF(type, c_type) \
    NONE(fmi3Get##type, const Reference r[], size_t n, c_type v[], size_t m) \
    NONE(fmi3Set##type, const Reference r[], size_t n, const c_type v[], size_t m)
#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
NONE_OF(Float32, float)
NONE_OF(Int8, int8_t)
NONE_OF(UInt8, uint8_t)
NONE_OF(Int16, int16_t)
NONE_OF(UInt16, uint16_t)
NONE_OF(Int32, int32_t)
NONE_OF(UInt32, uint32_t)
NONE_OF(Int64, int64_t)
NONE_OF(UInt64, uint64_t)
NONE_OF(Boolean, bool)
NONE_OF(String, char *)
NONE(fmi3GetBinary, const Reference r[], size_t n, size_t sizes[], const uint8_t *v[], size_t m)
NONE(fmi3SetBinary, const Reference r[], size_t n, const size_t sizes[], const uint8_t *const v[], size_t m)
NONE(fmi3GetClock, const Reference r[], size_t n, bool v[])
NONE(fmi3SetClock, const Reference r[], size_t n, const bool v[])
NONE(fmi3GetNumberOfVariableDependencies, Reference r, size_t *n)
NONE(fmi3GetVariableDependencies, Reference r, size_t a[], Reference b[], size_t c[], int kinds[], size_t n)
NONE(fmi3GetDirectionalDerivative, const Reference a[], size_t n, const Reference b[], size_t m, const double seed[], size_t k, double s[],
     size_t l)
NONE(fmi3GetAdjointDerivative, const Reference a[], size_t n, const Reference b[], size_t m, const double seed[], size_t k, double s[],
     size_t l)
NONE(fmi3GetIntervalDecimal, const Reference r[], size_t n, double v[], int q[])
NONE(fmi3GetIntervalFraction, const Reference r[], size_t n, uint64_t c[], uint64_t v[], int q[])
NONE(fmi3GetShiftDecimal, const Reference r[], size_t n, double v[])
NONE(fmi3GetShiftFraction, const Reference r[], size_t n, uint64_t c[], uint64_t v[])
NONE(fmi3SetIntervalDecimal, const Reference r[], size_t n, const double v[])
NONE(fmi3SetIntervalFraction, const Reference r[], size_t n, const uint64_t c[], const uint64_t v[])
NONE(fmi3SetShiftDecimal, const Reference r[], size_t n, const double v[])
NONE(fmi3SetShiftFraction, const Reference r[], size_t n, const uint64_t c[], const uint64_t v[])
NONE(fmi3GetOutputDerivatives, const Reference r[], size_t n, const int32_t orders[], double v[], size_t m)
NONE(fmi3ActivateModelPartition, Reference r, double time)

FMI3_Export fmi3Status FMI(fmi3EnterConfigurationMode)(fmi3Instance instance)
{
    return failed((Instance *)instance, "fmi3EnterConfigurationMode is not supported");
}

FMI3_Export fmi3Status FMI(fmi3ExitConfigurationMode)(fmi3Instance instance)
{
    return failed((Instance *)instance, "fmi3ExitConfigurationMode is not supported");
}
