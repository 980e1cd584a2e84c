#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/server/service_test.h"

namespace pepeseg {

// A server that requires keys. The project "default" has a scene "shelf" with the model of
// model_worker.cc, a label "red" and a selection; the project "other" is empty.
struct KeyedServer : ServiceTest {
  KeyedServer();

  // Creates a key with these scopes and returns its secret.
  std::string MakeKey(const std::string& project, const std::vector<v1::Scope>& scopes);
  // Returns a context with the key; "": without one.
  static std::unique_ptr<grpc::ClientContext> With(const std::string& secret);
  // Calls a method with the key.
  template <class Stub, class Request, class Response>
  Reply<Response> CallAs(const std::string& secret, Method<Stub, Request, Response> method,
                         const std::type_identity_t<Request>& request,
                         std::source_location where = std::source_location::current()) const {
    return CallWith(*With(secret), running.ChannelOf<Stub>(), method, request, where);
  }
  // Calls any method by its full name, as "pepeseg.v1.SceneService.GetScene": sends `messages`,
  // reads all responses, and returns the status.
  grpc::Status Ask(const std::string& method,
                   const std::vector<const google::protobuf::Message*>& messages,
                   const std::string& secret);
  grpc::Status Ask(const std::string& method, const google::protobuf::Message& request,
                   const std::string& secret) {
    return Ask(method, {&request}, secret);
  }
  std::string ReadAudit() const;
  std::string ReadRefusals() const;

  std::string job;                                       // the job that made the model
  std::string nobody, stranger, reader, full, operates;  // secrets
};

}  // namespace pepeseg
