#pragma once

#include <optional>
#include <random>
#include <string>

#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/message_mutator.h"

namespace pepeseg::fuzz {

template <class M>
std::optional<std::string> MutateAs(absl::string_view bytes, std::mt19937& random) {
  M message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return std::nullopt;
  MutateMessage(message, random);
  return message.SerializeAsString();
}

}  // namespace pepeseg::fuzz

// Defines a fuzz target that gets a message of the contract, parsed from the wire format.
//
//   PEPESEG_FUZZ_MESSAGE(upload_request, pepeseg::v1::CreateUploadRequest) { ... message ... }
#define PEPESEG_FUZZ_MESSAGE(name, Message)                                     \
  PEPESEG_FUZZ_MUTATOR(name, &pepeseg::fuzz::MutateAs<Message>)                 \
  static void FuzzMessage(const Message& message);                              \
  PEPESEG_FUZZ_TARGET(name) {                                                   \
    Message message;                                                            \
    if (message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) { \
      FuzzMessage(message);                                                     \
    }                                                                           \
  }                                                                             \
  static void FuzzMessage(const Message& message)
