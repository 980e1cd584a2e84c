#pragma once

#include <grpcpp/grpcpp.h>

namespace pepeseg {

// Decides whether the server that the builder makes has gRPC's reflection service, which lists all
// methods. Without this call it has: a program that is linked with gRPC's library for it registers
// the service for each server.
void SetReflection(grpc::ServerBuilder& builder, bool served);

}  // namespace pepeseg
