#include "server/api/gaussian_bits.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;

v1::GaussianBits Bits(const std::string& bytes) {
  v1::GaussianBits bits;
  bits.set_bits(bytes);
  return bits;
}

TEST(GaussianBits, HaveTheLowestBitFirst) {
  GaussianSet set;
  set.member = {1, 0, 1, 0, 0, 0, 0, 0, 0, 1};
  EXPECT_EQ(ToProto(set).bits(), std::string("\x05\x02"));
  ASSERT_OK_AND_ASSIGN(const GaussianSet back, SetFromProto(ToProto(set), 10, "gaussians.bits"));
  EXPECT_EQ(back.member, set.member);
}

TEST(GaussianBits, UseEveryBitOfEightGaussians) {
  ASSERT_OK_AND_ASSIGN(const GaussianSet all, SetFromProto(Bits("\xff"), 8, "gaussians.bits"));
  EXPECT_EQ(all.count(), 8);
  ASSERT_OK_AND_ASSIGN(const GaussianSet none, SetFromProto(Bits(""), 0, "gaussians.bits"));
  EXPECT_TRUE(none.member.empty());
}

TEST(GaussianBits, AreRefusedInAnotherNumber) {
  for (const std::string& bytes : {std::string(), std::string(1, '\0'), std::string(3, '\0')}) {
    EXPECT_STATUS(SetFromProto(Bits(bytes), 10, "gaussians.bits"), kInvalidArgument,
                  "10 Gaussians, which take 2 bytes");
  }
}

TEST(GaussianBits, AreRefusedBeyondTheLastGaussian) {
  EXPECT_STATUS(SetFromProto(Bits(std::string("\x01\x04")), 10, "gaussians.bits"), kInvalidArgument,
                "bit 10");
  EXPECT_STATUS(SetFromProto(Bits(std::string("\x01\x80")), 10, "gaussians.bits"), kInvalidArgument,
                "bit 15");
}

}  // namespace
}  // namespace pepeseg
