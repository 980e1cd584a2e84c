#include "core/edit/hole_picture.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

constexpr int kWidth = 20, kHeight = 16;

// A picture of the values 2 + 0.5 x - 0.25 y and 1, known everywhere.
HolePicture LinearPicture() {
  HolePicture picture{kWidth, kHeight, {}, {}, {}};
  picture.known.assign(kWidth * kHeight, 1);
  picture.hole.assign(kWidth * kHeight, 0);
  picture.values.resize(kWidth * kHeight, 2);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      picture.values.row(y * kWidth + x) << 2 + 0.5 * x - 0.25 * y, 1;
    }
  }
  return picture;
}

// Makes the rectangle [left, right) x [top, bottom) a hole with wrong values.
void Cut(int left, int right, int top, int bottom, HolePicture& picture) {
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const int i = y * kWidth + x;
      picture.known[i] = 0;
      picture.hole[i] = 1;
      picture.values.row(i).setConstant(-100);
    }
  }
}

TEST(HolePicture, ContinuesAPlaneExactly) {
  const HolePicture truth = LinearPicture();
  HolePicture picture = truth;
  Cut(5, 12, 4, 11, picture);
  Cut(15, 17, 2, 3, picture);
  EXPECT_EQ(KeepEnclosed(1, picture), 7 * 7 + 2);
  FillSmoothly(picture);
  EXPECT_LT((picture.values - truth.values).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(HolePicture, FillsWhatIsOpenAtTheEdgeFromTheKnownSides) {
  HolePicture picture = LinearPicture();
  Cut(0, 4, 0, kHeight, picture);
  EXPECT_EQ(KeepEnclosed(0.5, picture), 4 * kHeight);
  FillSmoothly(picture);
  for (int i = 0; i < kWidth * kHeight; ++i) EXPECT_NEAR(picture.values(i, 1), 1, 1e-9) << i;
}

TEST(HolePicture, DropsWhatLittleIsKnownAround) {
  HolePicture picture = LinearPicture();
  Cut(5, 12, 4, 11, picture);
  // Three sides of the hole show nothing.
  for (int k = 3; k < 12; ++k) {
    for (const int i : {3 * kWidth + k + 1, 11 * kWidth + k + 1, k * kWidth + 4}) {
      picture.known[i] = 0;
    }
  }
  HolePicture other = picture;
  EXPECT_EQ(KeepEnclosed(0.5, picture), 0);
  EXPECT_EQ(KeepEnclosed(0.2, other), 49);
  // Nothing at all is known around this one.
  HolePicture alone = LinearPicture();
  Cut(0, kWidth, 0, kHeight, alone);
  EXPECT_EQ(KeepEnclosed(0, alone), 0);
}

TEST(HolePicture, DilatesASquare) {
  std::vector<uint8_t> mask(kWidth * kHeight, 0);
  mask[5 * kWidth + 1] = 1;
  const std::vector<uint8_t> dilated = Dilated(mask, kWidth, kHeight, 2);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      EXPECT_EQ(dilated[y * kWidth + x], x <= 3 && y >= 3 && y <= 7 ? 1 : 0) << x << ", " << y;
    }
  }
}

}  // namespace
}  // namespace pepeseg
