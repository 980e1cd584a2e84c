#include "core/base/digest.h"

#include <gtest/gtest.h>

#include "core/base/file_io.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

// The example of FIPS 180-4.
constexpr char kAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

TEST(Sha256, MatchesTheExampleOfTheStandard) {
  EXPECT_EQ(Sha256Hex("abc"), kAbc);
  Sha256 digest;
  digest.Add(std::string_view("a"));
  digest.Add(std::string_view("bc"));
  EXPECT_EQ(digest.Hex(), kAbc);
}

TEST(Sha256, OfAFileEqualsThatOfItsBytes) {
  const testing::TempFolder folder;
  const std::string bytes((3 << 20) + 17, 'x');
  ASSERT_OK(WriteFileAtomically(folder / "a", bytes));
  ASSERT_OK_AND_ASSIGN(const std::string digest, Sha256OfFile(folder / "a"));
  EXPECT_EQ(digest, Sha256Hex(bytes));
  EXPECT_EQ(Sha256OfFile(folder / "b").status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace pepeseg
