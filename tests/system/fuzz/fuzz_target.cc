#include "tests/system/fuzz/fuzz_target.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#ifdef PEPESEG_FUZZ
extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t max_size);
#endif

namespace pepeseg::fuzz {

std::map<std::string, Target>& Targets() {
  static std::map<std::string, Target> targets;
  return targets;
}

std::map<std::string, Mutator>& Mutators() {
  static std::map<std::string, Mutator> mutators;
  return mutators;
}

bool AddTarget(const char* name, Target target) { return Targets().emplace(name, target).second; }

bool AddMutator(const char* name, Mutator mutator) {
  return Mutators().emplace(name, mutator).second;
}

void Expect(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz target: expected %s\n", what);
  std::abort();
}

#ifdef PEPESEG_FUZZ
size_t MutateInPlace(Mutator mutator, uint8_t* data, size_t size, size_t max_size, unsigned seed) {
  std::mt19937 random(seed);
  const auto changed = random() % 8 == 0
                           ? std::nullopt
                           : mutator({reinterpret_cast<const char*>(data), size}, random);
  if (!changed.has_value()) return LLVMFuzzerMutate(data, size, max_size);
  if (changed->size() > max_size) return size;
  std::copy(changed->begin(), changed->end(), data);
  return changed->size();
}
#endif

}  // namespace pepeseg::fuzz
