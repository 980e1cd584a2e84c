#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

namespace pepeseg {

inline constexpr int kServing = 1, kNotServing = 2;

// A connection of its own: channels to one address would share theirs.
std::shared_ptr<grpc::Channel> ConnectTo(int port);

// Answer of grpc.health.v1.Health/Check; -1: it failed.
int CheckHealth(const std::shared_ptr<grpc::Channel>& channel, const std::string& service);

}  // namespace pepeseg
