#pragma once

#include <cstring>
#include <random>
#include <string>

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/message_mutator.h"

// A fuzz target that takes a message of the contract, as it comes over the wire.
//
//   PEPESEG_FUZZ_MESSAGE(upload_request, pepeseg::v1::CreateUploadRequest) { ... message ... }
#ifdef PEPESEG_FUZZ
extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t max_size);

namespace pepeseg::fuzz {

// Every fourth time libFuzzer's own change of the bytes, of which it knows words and joins.
template <class M>
size_t MutateBytesOf(uint8_t* data, size_t size, size_t max_size, unsigned seed) {
  std::mt19937 random(seed);
  M message;
  if (random() % 4 == 0 || !message.ParseFromArray(data, static_cast<int>(size))) {
    return LLVMFuzzerMutate(data, size, max_size);
  }
  MutateMessage(message, random);
  const std::string bytes = message.SerializeAsString();
  if (bytes.size() > max_size) return size;
  std::memcpy(data, bytes.data(), bytes.size());
  return bytes.size();
}

}  // namespace pepeseg::fuzz

#define PEPESEG_FUZZ_MUTATOR(Message)                                                    \
  extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t max_size, \
                                            unsigned seed) {                             \
    return pepeseg::fuzz::MutateBytesOf<Message>(data, size, max_size, seed);            \
  }
#else
#define PEPESEG_FUZZ_MUTATOR(Message)
#endif

#define PEPESEG_FUZZ_MESSAGE(name, Message)                                     \
  PEPESEG_FUZZ_MUTATOR(Message)                                                 \
  static void FuzzMessage(const Message& message);                              \
  PEPESEG_FUZZ_TARGET(name) {                                                   \
    Message message;                                                            \
    if (message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) { \
      FuzzMessage(message);                                                     \
    }                                                                           \
  }                                                                             \
  static void FuzzMessage(const Message& message)
