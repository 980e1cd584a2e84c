#include "tests/testing/benchmark_miniatures.h"

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/formats/rle.h"
#include "tests/testing/colmap_files.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg::testing {
namespace {

namespace fs = std::filesystem;

constexpr int kNumViews = 10, kMiniatureWidth = 96, kMiniatureHeight = 72;

const SyntheticScene& Scene() {
  static const SyntheticScene scene = MakeSyntheticScene({.num_views = kNumViews,
                                                          .width = kMiniatureWidth,
                                                          .height = kMiniatureHeight,
                                                          .held_out_every = 0,
                                                          .num_points = 400});
  return scene;
}

std::string Named(const char* format, int index) {
  return absl::StrFormat(*absl::ParsedFormat<'d'>::New(format), index);
}

std::string GreyPng(const std::vector<uint8_t>& pixels) {
  return Png({kMiniatureWidth, kMiniatureHeight, 1, pixels});
}

// Returns the pixels of a label as 255.
std::vector<uint8_t> MaskOfLabel(int view, int label) {
  std::vector<uint8_t> mask;
  for (const uint8_t pixel : Scene().labels[view]) mask.push_back(pixel == label ? 255 : 0);
  return mask;
}

// Writes the photographs, and the poses that name them. `format`: their names.
void WritePhotographs(const fs::path& folder, const char* format) {
  std::vector<ImageRecord> images;
  for (int i = 0; i < kNumViews; ++i) {
    const View& view = Scene().capture.views[i];
    WriteBytes(folder / "images" / Named(format, i), Png(view.photo));
    const auto& q = view.cam_from_world.rotation;
    const auto& t = view.cam_from_world.translation;
    images.push_back({static_cast<uint32_t>(i + 1),
                      {q.w(), q.x(), q.y(), q.z()},
                      {t.x(), t.y(), t.z()},
                      1,
                      Named(format, i),
                      0});
  }
  const Camera& camera = Scene().capture.views[0].camera;
  const std::vector<CameraRecord> cameras = {{1,
                                              1,
                                              "PINHOLE",
                                              kMiniatureWidth,
                                              kMiniatureHeight,
                                              {camera.fx, camera.fy, camera.cx, camera.cy}}};
  std::vector<PointRecord> points;
  for (const ScenePoint& point : Scene().capture.points) {
    const Eigen::Vector3f& p = point.position;
    points.push_back(
        {points.size() + 1, {p.x(), p.y(), p.z()}, {point.rgb[0], point.rgb[1], point.rgb[2]}, 0});
  }
  WriteBytes(folder / "sparse/0/cameras.bin", CamerasBinary(cameras));
  WriteBytes(folder / "sparse/0/images.bin", ImagesBinary(images));
  WriteBytes(folder / "sparse/0/points3D.bin", PointsBinary(points));
}

// Writes the label image of each view. `format`: their names.
void WriteLabels(const fs::path& folder, const char* format) {
  for (int i = 0; i < kNumViews; ++i) {
    WriteBytes(folder / Named(format, i), GreyPng(Scene().labels[i]));
  }
}

void WriteLlffScene(const fs::path& folder) {
  WritePhotographs(folder, "IMG_%03d.png");
  for (int i = 0; i < kNumViews; ++i) {
    WriteBytes(folder / "images_4" / Named("image%03d.png", i),
               Png(Scene().capture.views[i].photo));
  }
  WriteLabels(folder / "masks", "image%03d.png");
}

// Returns a stroke: of the label's pixels every `step`-th.
std::vector<uint8_t> Stroke(int view, int label, int step) {
  std::vector<uint8_t> stroke = MaskOfLabel(view, label);
  int count = 0;
  for (uint8_t& pixel : stroke) {
    if (pixel != 0 && count++ % step != 0) pixel = 0;
  }
  return stroke;
}

}  // namespace

void WriteNvosMiniature(const fs::path& folder) {
  WriteLlffScene(folder / "table");
  WriteBytes(folder / "reference_image/table/IMG_003.png", Png(Scene().capture.views[3].photo));
  WriteBytes(folder / "scribbles/table/pos_0_IMG_003.png", GreyPng(Stroke(3, kGreenBall, 5)));
  WriteBytes(folder / "scribbles/table/neg_0_IMG_003.png", GreyPng(Stroke(3, kRedBox, 5)));
  WriteBytes(folder / "masks/table/IMG_005_mask.png", GreyPng(MaskOfLabel(5, kGreenBall)));
}

void WriteSpinNerfMiniature(const fs::path& folder) {
  WriteLlffScene(folder / "table");
  for (int i = 0; i < kNumViews; i += 2) {
    WriteBytes(folder / "table/object_masks" / Named("image%03d.png", i),
               GreyPng(MaskOfLabel(i, kGreenBall)));
  }
}

void WriteLerfMaskMiniature(const fs::path& folder) {
  WritePhotographs(folder / "table", "frame_%05d.png");
  WriteLabels(folder / "table/masks", "frame_%05d.png");
  for (const int i : {2, 5, 8}) {
    const fs::path view = folder / "table/test_mask" / Named("frame_%05d", i);
    WriteBytes(view / "green ball.png", GreyPng(MaskOfLabel(i, kGreenBall)));
    WriteBytes(view / "red box.png", GreyPng(MaskOfLabel(i, kRedBox)));
  }
}

void WriteOwnMiniature(const fs::path& folder) {
  WritePhotographs(folder, "%03d.png");
  WriteLabels(folder / "labels", "%03d.png");
  for (int i = 0; i < kNumViews; ++i) {
    std::vector<std::string> masks;
    for (int label = 1; label <= kNumObjects; ++label) {
      BinaryMask mask{MaskOfLabel(i, label)};
      for (uint8_t& pixel : mask.pixels) pixel = pixel != 0 ? 1 : 0;
      // EncodeCocoRle writes printable characters, of which JSON escapes the backslash.
      const nlohmann::json json = {
          {"segmentation",
           {{"size", {kMiniatureHeight, kMiniatureWidth}},
            {"counts", EncodeCocoRle(mask, kMiniatureWidth, kMiniatureHeight)}}},
          {"predicted_iou", 0.95},
          {"stability_score", 0.97}};
      masks.push_back(json.dump());
    }
    WriteBytes(folder / "masks" / Named("%03d.json", i),
               absl::StrCat("[", absl::StrJoin(masks, ","), "]"));
  }
}

}  // namespace pepeseg::testing
