// Every file that a fuzzer started from, or found something with, once.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"

namespace pepeseg::fuzz {
namespace {

namespace fs = std::filesystem;

class FuzzCorpus : public ::testing::TestWithParam<std::string> {};

TEST_P(FuzzCorpus, IsReadWithoutHarm) {
  const Target target = Targets().at(GetParam());
  target({});
  int num_files = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(PEPESEG_FUZZ_CORPUS) / GetParam())) {
    SCOPED_TRACE(entry.path().string());
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    target(bytes);
    // Cut short too.
    target(absl::string_view(bytes).substr(0, bytes.size() / 2));
    ++num_files;
  }
  EXPECT_GT(num_files, 0);
}

TEST(FuzzTargets, HaveACorpusEach) {
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
