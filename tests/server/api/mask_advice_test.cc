#include "server/api/mask_advice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(AdviceOnMaskQuality, NamesTheQualityAndTheRemedy) {
  EXPECT_THAT(AdviceOnMaskQuality({{"masks", "given"}}, 0.314),
              ElementsAre(AllOf(HasSubstr("disagree"), HasSubstr("0.31"), HasSubstr("0.5"),
                                HasSubstr("pepeseg-priors"))));
}

TEST(AdviceOnMaskQuality, IsEmptyForMasksThatAgree) {
  EXPECT_THAT(AdviceOnMaskQuality({{"masks", "given"}}, kGoodMaskQuality), IsEmpty());
  EXPECT_THAT(AdviceOnMaskQuality({}, 0.9), IsEmpty());
}

TEST(AdviceOnMaskQuality, DoesNotRepeatTheAdviceOnTheirSource) {
  EXPECT_THAT(AdviceOnMaskQuality({{"masks", "embedded"}}, 0.1), IsEmpty());
}

}  // namespace
}  // namespace pepeseg
