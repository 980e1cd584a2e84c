// Runs each fuzz target on each file of its corpus, and on random changes of them for one second
// (PEPESEG_FUZZ_SECONDS). The changes are not guided by coverage; those of `make fuzz` are.
#include <google/protobuf/stubs/logging.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "tests/system/fuzz/byte_mutator.h"
#include "tests/system/fuzz/fuzz_target.h"

namespace pepeseg::fuzz {
namespace {

namespace fs = std::filesystem;

// Returns the number in an environment variable, or `fallback`.
int Setting(const char* name, int fallback) {
  const char* value = std::getenv(name);
  int number = fallback;
  if (value != nullptr && !absl::SimpleAtoi(value, &number)) ADD_FAILURE() << name << ": " << value;
  return number;
}

class FuzzCorpus : public ::testing::TestWithParam<std::string> {
 protected:
  FuzzCorpus() {
    for (const auto& entry : fs::directory_iterator(fs::path(PEPESEG_FUZZ_CORPUS) / GetParam())) {
      std::ifstream file(entry.path(), std::ios::binary);
      files_.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    }
  }

  const std::string& AnyFile(std::mt19937& random) const {
    return files_[random() % files_.size()];
  }

  // Uses the target's own mutator three times in four.
  std::string AnyInput(std::mt19937& random) const {
    const auto own = Mutators().find(GetParam());
    if (own != Mutators().end() && random() % 4 != 0) {
      auto changed = own->second(AnyFile(random), random);
      for (size_t i = random() % 4; changed.has_value() && i > 0; --i) {
        changed = own->second(*changed, random);
      }
      if (changed.has_value()) return *changed;
    }
    return MutateBytes(AnyFile(random), AnyFile(random), random);
  }

  const Target target_ = Targets().at(GetParam());
  std::vector<std::string> files_;
};

TEST_P(FuzzCorpus, IsReadWithoutCrashing) {
  ASSERT_FALSE(files_.empty());
  target_({});
  for (const std::string& bytes : files_) {
    target_(bytes);
    // Also cuts the input short.
    target_(absl::string_view(bytes).substr(0, bytes.size() / 2));
  }
}

// With the same seed, a run of at least the same duration repeats all inputs.
TEST_P(FuzzCorpus, IsReadWithoutCrashingAfterRandomChanges) {
  ASSERT_FALSE(files_.empty());
  const int seed = Setting("PEPESEG_FUZZ_SEED", static_cast<int>(std::random_device()() >> 1));
  std::fprintf(stderr, "PEPESEG_FUZZ_SEED=%d\n", seed);
  std::mt19937 random(static_cast<unsigned>(seed));
  const google::protobuf::LogSilencer quiet;
  const auto end =
      std::chrono::steady_clock::now() + std::chrono::seconds(Setting("PEPESEG_FUZZ_SECONDS", 1));
  int num_inputs = 0;
  for (; std::chrono::steady_clock::now() < end; ++num_inputs) target_(AnyInput(random));
  std::fprintf(stderr, "%d inputs\n", num_inputs);
}

TEST(FuzzTargets, EachHaveACorpus) {
  EXPECT_GE(Targets().size(), 20u);
  for (const auto& entry : fs::directory_iterator(PEPESEG_FUZZ_CORPUS)) {
    EXPECT_TRUE(Targets().contains(entry.path().filename().string())) << entry.path();
  }
}

std::vector<std::string> Names() {
  std::vector<std::string> names;
  for (const auto& [name, target] : Targets()) names.push_back(name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Targets, FuzzCorpus, ::testing::ValuesIn(Names()),
                         [](const auto& named) { return named.param; });

}  // namespace
}  // namespace pepeseg::fuzz
