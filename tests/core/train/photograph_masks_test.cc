#include "core/train/photograph_masks.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <vector>

#include "core/base/digest.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

TEST(MaskWarp, TurnsMasksOfTheUprightPhotographToTheView) {
  View view;
  view.camera = {.width = 4, .height = 3, .fx = 4, .fy = 4, .cx = 2, .cy = 1.5};
  Lens lens;
  lens.width = 4, lens.height = 3, lens.fx = lens.fy = 4, lens.cx = 2, lens.cy = 1.5;
  view.photograph = Photograph{lens, 6, 0, 0, 4, 3};
  // Upright, the photograph is 3x4; its first stored pixel is at the right of the first scanline.
  BinaryMask mask{std::vector<uint8_t>(12, 0)};
  mask.pixels[2] = 1;
  const MaskSet upright = BuildMaskSet(3, 4, {{mask}});
  MaskWarp warp;
  const MaskSet stored = warp.ToView(upright, view);
  ASSERT_EQ(stored.width, 4);
  ASSERT_EQ(stored.height, 3);
  EXPECT_EQ(stored.mask_area, (std::vector<int64_t>{1}));
  EXPECT_TRUE(stored.Covers(0, 0, 0));
}

TEST(MoveEmbeddings, TakesThoseOfViewsThatHaveOne) {
  const testing::TempFolder folder;
  const auto from = folder / "from", to = folder / "to";
  std::filesystem::create_directories(from);
  const EmbeddingOrigin origin = {Sha256Hex("an encoder"), ""};
  const SamEmbedding embedding = {4, 3, std::vector<Half>(8)};
  for (const char* name : {"a/1.jpg", "a/2.jpg", "of no view.jpg"}) {
    ASSERT_OK(WriteEmbedding(from / EmbeddingFileName(name), embedding, origin));
  }
  std::vector<View> views(3);
  views[0].name = "a/1.jpg", views[1].name = "a/2.jpg", views[2].name = "held out.jpg";
  EXPECT_EQ(MoveEmbeddings(from, views, to), 2);
  EXPECT_OK(ReadEmbedding(to / EmbeddingFileName("a/1.jpg"), origin));
  EXPECT_OK(ReadEmbedding(to / EmbeddingFileName("a/2.jpg"), origin));
  EXPECT_TRUE(std::filesystem::exists(from / EmbeddingFileName("of no view.jpg")));
  EXPECT_EQ(MoveEmbeddings(folder / "nowhere", views, to), 0);
}

}  // namespace
}  // namespace pepeseg
