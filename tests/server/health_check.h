#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

namespace pepeseg {

inline constexpr int kServing = 1, kNotServing = 2;

// Returns a channel with its own connection: channels to one address share theirs by default.
std::shared_ptr<grpc::Channel> ConnectTo(int port);

// Returns the status that grpc.health.v1.Health/Check answers; -1: the call failed.
int CheckHealth(const std::shared_ptr<grpc::Channel>& channel, const std::string& service);

}  // namespace pepeseg
