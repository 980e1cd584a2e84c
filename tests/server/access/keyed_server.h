#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/server/running_server.h"

namespace pepeseg {

// A server that asks for keys. Of project "default" are a scene "shelf" with the model of
// model_worker.cc, a label "red" and a selection, of "other" nothing yet.
struct KeyedServer : ::testing::Test {
  KeyedServer();

  // A secret with these scopes.
  std::string MakeKey(const std::string& project, const std::vector<v1::Scope>& scopes);
  // A context with the key ("": none).
  static std::unique_ptr<grpc::ClientContext> With(const std::string& secret);
  // From outside, whatever the method is: sends `messages`, reads what comes, answers the end.
  // `method`: "pepeseg.v1.SceneService.GetScene".
  grpc::Status Ask(const std::string& method,
                   const std::vector<const google::protobuf::Message*>& messages,
                   const std::string& secret);
  grpc::Status Ask(const std::string& method, const google::protobuf::Message& request,
                   const std::string& secret) {
    return Ask(method, {&request}, secret);
  }
  std::string ReadAudit() const;
  std::string ReadRefusals() const;

  RunningServer running;
  std::string job;                                       // that made the model
  std::string nobody, stranger, reader, full, operates;  // secrets
};

}  // namespace pepeseg
