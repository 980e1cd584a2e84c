#pragma once

#include <grpcpp/client_context.h>

#include <string>

#include "clients/cpp/resource_names.h"

namespace pepeseg::client {

// The context of one call: carries the scene as routing key "x-scene" ("" for none) and ends the
// call after `seconds` (0: never, for streams that last as long as a job).
class Call {
 public:
  Call(const std::string& scene, double seconds);
  operator grpc::ClientContext*() { return &context_; }  // NOLINT(google-explicit-constructor)
  void Cancel() { context_.TryCancel(); }

 private:
  grpc::ClientContext context_;
};

constexpr double kCallSeconds = 120;  // the first question to a model loads it

}  // namespace pepeseg::client
