#include "clients/cpp/digest.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

TEST(Sha256, MatchesThePublishedVectors) {
  Sha256 whole;
  whole.Add("abc");
  EXPECT_EQ(whole.Finish(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  Sha256 pieces;
  pieces.Add("a");
  pieces.Add("");
  pieces.Add("bc");
  EXPECT_EQ(pieces.Finish(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(DigestFile, NamesAMissingFile) {
  const auto digest = DigestFile("/nowhere/photo.jpg");
  EXPECT_EQ(digest.status().code(), absl::StatusCode::kNotFound);
  EXPECT_NE(std::string(digest.status().message()).find("/nowhere/photo.jpg"), std::string::npos);
}

TEST(DigestFile, ReturnsSizeAndDigest) {
  const auto digest = DigestFile(PEPESEG_TEST_DATA "/apc_shelf/ignore_mask.png");
  ASSERT_OK(digest);
  EXPECT_EQ(digest->size, 2257);
  EXPECT_EQ(digest->sha256.size(), 64U);
}

}  // namespace
}  // namespace pepeseg::client
