#include "clients/cli/gaussian_indices.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

using absl::StatusCode::kInvalidArgument;

TEST(BitsOfIndices, HasTheLowestBitFirst) {
  const auto bits = BitsOfIndices("0\n9\r\n\n 2 \n2\n", "picked.txt", 10);
  ASSERT_OK(bits);
  EXPECT_EQ(*bits, std::string("\x05\x02"));
  EXPECT_EQ(*BitsOfIndices("", "picked.txt", 9), std::string(2, '\0'));
  EXPECT_EQ(*BitsOfIndices("7", "picked.txt", 8), std::string("\x80"));
}

TEST(BitsOfIndices, NamesTheLineThatIsNoIndex) {
  for (const char* wrong : {"10", "-1", "1.5", "1 2", "x", "99999999999999999999"}) {
    EXPECT_STATUS(BitsOfIndices(std::string("3\n\n") + wrong, "picked.txt", 10), kInvalidArgument,
                  "picked.txt, line 3: \"" + std::string(wrong) + "\"");
  }
  EXPECT_STATUS(BitsOfIndices("10", "picked.txt", 10), kInvalidArgument, "from 0 to 9");
}

TEST(ReadIndices, ReadsAFile) {
  const testing::TempFolder folder;
  std::ofstream(folder / "picked.txt") << "1\n2\n";
  const auto text = ReadIndices((folder / "picked.txt").string());
  ASSERT_OK(text);
  EXPECT_EQ(*text, "1\n2\n");
  EXPECT_FALSE(ReadIndices((folder / "none.txt").string()).ok());
}

}  // namespace
}  // namespace pepeseg::client::cli
