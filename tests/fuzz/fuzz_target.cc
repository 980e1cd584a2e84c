#include "tests/fuzz/fuzz_target.h"

#include <cstdio>
#include <cstdlib>

namespace pepeseg::fuzz {

std::map<std::string, Target>& Targets() {
  static std::map<std::string, Target> targets;
  return targets;
}

bool AddTarget(const char* name, Target target) { return Targets().emplace(name, target).second; }

void Expect(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz target: expected %s\n", what);
  std::abort();
}

}  // namespace pepeseg::fuzz
