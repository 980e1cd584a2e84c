#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <string>

#include "absl/strings/string_view.h"

// A fuzz target is a function of untrusted bytes. It must return for any input, and aborts if the
// code under test breaks its contract. Built for libFuzzer (PEPESEG_FUZZ) each target is a program.
// Otherwise all are in one test, which replays the files of tests/system/fuzz/corpus/NAME and
// changes them at random.
//
//   PEPESEG_FUZZ_TARGET(npy) { ... bytes ... }
namespace pepeseg::fuzz {

using Target = void (*)(absl::string_view bytes);

// A mutator returns other bytes of the same format; nothing if these do not have the format.
using Mutator = std::optional<std::string> (*)(absl::string_view bytes, std::mt19937& random);

// All targets and mutators by name, filled before main(). Most targets have no mutator.
std::map<std::string, Target>& Targets();
std::map<std::string, Mutator>& Mutators();
bool AddTarget(const char* name, Target target);
bool AddMutator(const char* name, Mutator mutator);

// Prints the words and aborts: the code under test has broken its contract.
void Expect(bool holds, const char* what);

#ifdef PEPESEG_FUZZ
// The mutator that libFuzzer calls. One time in eight it uses libFuzzer's own mutations, which have
// dictionaries and joins.
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
