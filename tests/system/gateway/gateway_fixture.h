#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "tests/server/call.h"
#include "tests/system/gateway/fleet.h"

namespace pepeseg::testing {

// One server behind a gateway, shared by all tests of the program.
class GatewayTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite();
  static void TearDownTestSuite() { fleet_.reset(); }
  void SetUp() override;

  static Fleet& fleet() { return *fleet_; }
  // Returns a JWT of project "lab" with these scopes.
  static std::string Token(const std::string& scope = "read write train") {
    return fleet().issuer.Sign(TokenIssuer::Claims("lab", scope));
  }

  // Make one call each, over a new connection unless a channel is given.
  using Metadata = std::vector<std::pair<std::string, std::string>>;
  static grpc::Status List(const std::shared_ptr<grpc::Channel>& channel,
                           const Metadata& metadata = {});
  static grpc::Status List(const std::string& token, const Metadata& metadata = {}) {
    return List(fleet().Connect(token), metadata);
  }
  // Makes this number of calls at once, and returns how often each text was answered.
  static std::map<std::string, int> ListAtOnce(const std::string& token, int num_calls);
  static grpc::Status CreateScene(const std::string& token, const std::string& id);
  static grpc::Status GetScene(const std::string& token, const std::string& id);

 private:
  static std::unique_ptr<Fleet> fleet_;
};

// Returns the name of the status code, and the message.
std::string TextOf(const grpc::Status& status);

}  // namespace pepeseg::testing
