#include "core/base/module.h"

#include <dlfcn.h>

#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace pepeseg {

std::filesystem::path ModulePath(const char* name) {
  std::error_code ignored;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", ignored);
  return program.parent_path().parent_path() / "lib" / "pepeseg" / absl::StrCat(name, ".so");
}

absl::StatusOr<void*> LoadModule(const char* name, const char* symbol) {
  const std::string path = ModulePath(name);
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const address = library != nullptr ? dlsym(library, symbol) : nullptr;
  if (address != nullptr) return address;
  const char* why = dlerror();
  return absl::FailedPreconditionError(
      absl::StrCat("the module ", name, " cannot be loaded: ", why != nullptr ? why : path));
}

}  // namespace pepeseg
