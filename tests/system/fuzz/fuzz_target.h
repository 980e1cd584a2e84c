#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <string>

#include "absl/strings/string_view.h"

// A fuzz target is a function of bytes that nobody has vouched for; it must come back, whatever
// they are, and aborts where what it finds cannot be. Built for libFuzzer (PEPESEG_FUZZ) each is a
// program; else all of them are in one test, which replays the files of
// tests/system/fuzz/corpus/NAME and changes them at random.
//
//   PEPESEG_FUZZ_TARGET(npy) { ... bytes ... }
namespace pepeseg::fuzz {

using Target = void (*)(absl::string_view bytes);

// Other bytes that keep the shape of these; none where these have no shape.
using Mutator = std::optional<std::string> (*)(absl::string_view bytes, std::mt19937& random);

// By name; filled before main(). Most targets have no mutator of their own.
std::map<std::string, Target>& Targets();
std::map<std::string, Mutator>& Mutators();
bool AddTarget(const char* name, Target target);
bool AddMutator(const char* name, Mutator mutator);

// Aborts, with the words: what is expected of the code under test does not hold.
void Expect(bool holds, const char* what);

#ifdef PEPESEG_FUZZ
// What libFuzzer asks for: every eighth time its own change of the bytes, of which it knows words
// and joins.
size_t MutateInPlace(Mutator mutator, uint8_t* data, size_t size, size_t max_size, unsigned seed);
#endif

}  // namespace pepeseg::fuzz

#ifdef PEPESEG_FUZZ
#define PEPESEG_FUZZ_TARGET(name)                                           \
  static void FuzzBytes(absl::string_view bytes);                           \
  extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) { \
    FuzzBytes({reinterpret_cast<const char*>(data), size});                 \
    return 0;                                                               \
  }                                                                         \
  static void FuzzBytes(absl::string_view bytes)
#define PEPESEG_FUZZ_MUTATOR(name, mutator)                                              \
  extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t max_size, \
                                            unsigned seed) {                             \
    return pepeseg::fuzz::MutateInPlace(mutator, data, size, max_size, seed);            \
  }
#else
#define PEPESEG_FUZZ_TARGET(name)                        \
  static void name##FuzzBytes(absl::string_view bytes);  \
  [[maybe_unused]] static const bool name##_is_known =   \
      pepeseg::fuzz::AddTarget(#name, &name##FuzzBytes); \
  static void name##FuzzBytes(absl::string_view bytes)
#define PEPESEG_FUZZ_MUTATOR(name, mutator) \
  [[maybe_unused]] static const bool name##_has_mutator = pepeseg::fuzz::AddMutator(#name, mutator);
#endif
