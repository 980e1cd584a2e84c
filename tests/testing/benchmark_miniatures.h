#pragma once

#include <filesystem>

namespace pepeseg::testing {

// Each writes a miniature of a benchmark's folder, in exactly its layout, with one scene of 10
// ray-traced views of 96x72 pixels (see MakeSyntheticScene) and label images as masks.

// The LLFF scene "table": images/IMG_NNN.png, images_4/imageNNN.png, sparse/0/, and masks/ named as
// the copies. The object is the ball.
//   nvos       reference_image/table/IMG_003.png, scribbles/table/, masks/table/IMG_005_mask.png
//   spin-nerf  table/object_masks/imageNNN.png of every second view
void WriteNvosMiniature(const std::filesystem::path& folder);
void WriteSpinNerfMiniature(const std::filesystem::path& folder);

// The scene "table" with test_mask/frame_0000N/ of the views 2, 5 and 8: "red box.png" and
// "green ball.png".
void WriteLerfMaskMiniature(const std::filesystem::path& folder);

// A scene of our own: images/, sparse/0/, masks/STEM.json as SAM writes them, and labels/.
void WriteOwnMiniature(const std::filesystem::path& folder);

}  // namespace pepeseg::testing
