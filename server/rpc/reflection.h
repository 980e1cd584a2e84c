#pragma once

#include "absl/status/status.h"

namespace pepeseg {

// Adds gRPC's reflection service, which lists all methods, to every server that is built
// afterwards. Loads gRPC's library at run time: a program that is linked with it serves reflection
// whether it wants to or not. UNAVAILABLE: the library is not installed.
absl::Status EnableReflection();

}  // namespace pepeseg
