#include "server/rpc/reflection.h"

#include <dlfcn.h>
#include <grpcpp/grpcpp.h>

#include <string>

#include "absl/strings/str_cat.h"

namespace pepeseg {

absl::Status EnableReflection() {
  // Libraries of gRPC are binary compatible within major and minor version: "1.51.1" is in
  // libgrpc++_reflection.so.1.51.
  const std::string version = grpc::Version();
  const std::string library =
      absl::StrCat("libgrpc++_reflection.so.", version.substr(0, version.rfind('.')));
  // A constructor of the library registers the service.
  if (dlopen(library.c_str(), RTLD_NOW | RTLD_GLOBAL) != nullptr) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("--reflection: ", dlerror(), "; install it, or start without --reflection"));
}

}  // namespace pepeseg
