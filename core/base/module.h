#pragma once

#include <filesystem>

#include "absl/status/statusor.h"

// Modules: shared libraries of this project that a program loads when it needs them, so that their
// own libraries do not slow the start of every run. They lie in lib/pepeseg next to the program's
// bin: /usr/lib/pepeseg for /usr/bin.
namespace pepeseg {

// Returns the path of a module, whether it is there or not. `name` is as in "video".
std::filesystem::path ModulePath(const char* name);

// Loads a module for good and returns the address of its function `symbol`. May be called again.
// FAILED_PRECONDITION: the module or one of its libraries is not installed.
absl::StatusOr<void*> LoadModule(const char* name, const char* symbol);

}  // namespace pepeseg
