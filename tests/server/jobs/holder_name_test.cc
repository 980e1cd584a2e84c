#include "server/jobs/holder_name.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(HolderName, NamesALivingProcess) {
  const std::string name = HolderName();
  EXPECT_EQ(name, HolderName());
  EXPECT_FALSE(IsKnownGone(name));
  EXPECT_TRUE(IsKnownGone(name + "1"));  // an earlier process had this id
  EXPECT_FALSE(IsKnownGone("another-boot/pid:[1]/1/2"));
  EXPECT_FALSE(IsKnownGone(""));
  EXPECT_FALSE(IsKnownGone("server"));
}

}  // namespace
}  // namespace pepeseg
