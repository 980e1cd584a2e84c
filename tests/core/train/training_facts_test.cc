#include "core/train/training_facts.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "tests/testing/png_bytes.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

TEST(FactsOf, LeavesOutMasksAndDepthOnRequest) {
  TrainingInputs inputs;
  inputs.files = {{FileKind::kMask, "masks/a.png", ""}, {FileKind::kDepth, "depth/a.png", ""}};
  TrainingSettings settings;
  EXPECT_TRUE(FactsOf(inputs, settings, false).has_masks);
  EXPECT_TRUE(FactsOf(inputs, settings, false).has_depth);
  settings.import.use_masks = settings.import.use_depth = false;
  EXPECT_FALSE(FactsOf(inputs, settings, false).has_masks);
  EXPECT_FALSE(FactsOf(inputs, settings, false).has_depth);
}

TEST(FactsOf, CountsNoMasksThatSayWhatToIgnore) {
  const testing::TempFolder folder;
  std::ofstream(folder / "transforms.json")
      << R"({"frames": [{"file_path": "images/a.png", "mask_path": "masks/a.png"}]})";
  TrainingInputs inputs;
  inputs.files = {{FileKind::kImage, "images/a.png", ""},
                  {FileKind::kPoses, "transforms.json", folder / "transforms.json"},
                  {FileKind::kMask, "masks/a.png", ""}};
  EXPECT_FALSE(FactsOf(inputs, TrainingSettings(), false).has_masks);
  inputs.files.push_back({FileKind::kMask, "masks/b.png", ""});
  EXPECT_TRUE(FactsOf(inputs, TrainingSettings(), false).has_masks);
}

TEST(FactsOf, ReadsTheSizesOfPhotographsFromTheirHeaders) {
  const testing::TempFolder folder;
  TrainingInputs inputs;
  for (const int width : {1000, 3000}) {
    const std::string name = std::to_string(width) + ".png";
    std::ofstream(folder / name, std::ios::binary) << testing::BlackPng(width, 500, 8);
    inputs.files.push_back({FileKind::kImage, "images/" + name, folder / name});
  }
  inputs.files.push_back({FileKind::kImage, "images/lost.png", folder / "lost.png"});
  TrainingSettings settings;
  settings.import.image_scale = 0.5;
  const TrainingFacts facts = FactsOf(inputs, settings, false);
  EXPECT_EQ(facts.num_photographs, 3);
  EXPECT_DOUBLE_EQ(facts.photo_megapixels, 1);
  EXPECT_DOUBLE_EQ(facts.megapixels, 0.25);
}

TEST(FactsOf, AssumesAMegapixelWhereNoPhotographCanBeRead) {
  TrainingInputs inputs;
  inputs.files = {{FileKind::kImage, "images/lost.png", "/nowhere/lost.png"}};
  EXPECT_EQ(FactsOf(inputs, TrainingSettings(), false).photo_megapixels, 1);
}

}  // namespace
}  // namespace pepeseg
