#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "clients/benchmark/scene_truth.h"
#include "clients/cpp/dataset_folder.h"

// The scenes of the field's benchmarks, as their folders on the disk have them.
namespace pepeseg::client::cli {

enum class Benchmark { kNvos, kSpinNerf, kLerfMask, kLerfMaskFine, kScene };

// Returns the benchmark of a name such as "spin-nerf", and its name. `name` is one of
// BenchmarkNames().
Benchmark BenchmarkOf(absl::string_view name);
std::string NameOf(Benchmark benchmark);
const std::vector<std::string>& BenchmarkNames();

// The mask of an entity in a view, a PNG file whose pixels that are not 0 are inside. It may have
// another size than the photograph, of the same shape.
struct TruthFile {
  std::string entity;
  std::string view;  // name of the photograph below images/
  std::filesystem::path mask;
};

// The prompt of an entity, in its reference view.
struct ReferencePrompt {
  std::string entity;
  std::string view;
  // Strokes of a benchmark with scribbles; without positive ones the prompt is a mask.
  std::vector<std::filesystem::path> positive, negative;
  std::filesystem::path mask;  // empty, without strokes: the entity's own mask in `view`
};

// A scene of a benchmark.
struct BenchmarkScene {
  std::string name;                         // "horns_left"
  std::filesystem::path folder;             // of its photographs
  DatasetFolder dataset;                    // the files to upload
  std::vector<std::string> held_out_views;  // empty: every 8th view by name
  std::vector<TruthFile> truth;             // by entity and view
  std::vector<ReferencePrompt> prompts;     // one for each entity
  std::vector<TruthLevel> levels;           // truth of kScene, in place of truth and prompts
};

// Returns the names of the views that are held out: scene.held_out_views, or every 8th by name.
std::vector<std::string> HeldOutViews(const BenchmarkScene& scene);

// Options of FindScenes.
struct SceneSearch {
  std::vector<std::string> scenes;  // names; empty: all
  std::string images;  // folder of the photographs of LLFF scenes, "images_4"; empty: the first of
                       // images_4, images_8, images_2 and images that exists
};

// Finds the scenes of a benchmark below `folder`, by name:
//   kNvos      reference_image/SCENE/IMAGE.*, scribbles/SCENE/pos_*.png and neg_*.png (or one other
//              PNG, the reference mask), masks/SCENE/TARGET_mask.png, and the LLFF scene in SCENE/,
//              scenes/SCENE/ or nerf_llff_data/SCENE/, where the last "_..." of SCENE may be left
//              out
//   kSpinNerf  SCENE/ or scenes/SCENE/, an LLFF scene, and SCENE/object_masks/*.png or
//              masks/SCENE/*.png: one an annotated view, named as its photograph, or imageNNN: the
//              NNNth photograph by name, from 0
//   kLerfMask, kLerfMaskFine
//              SCENE/ with images/, sparse/0/ and test_mask/VIEW/PROMPT.png
//   kScene     SCENE/ with images/ and label images or outlines (see FindTruth); or such a folder
//              itself. The photographs with outlines are held out if they are at most a quarter of
//              all
// An LLFF scene has images/, images_2/, images_4/ or images_8/, and sparse/0/ or poses_bounds.npy.
// INVALID_ARGUMENT: nothing of that layout is there, or a part of it is missing; the message says
// what was looked for, and where.
absl::StatusOr<std::vector<BenchmarkScene>> FindScenes(Benchmark benchmark,
                                                       const std::filesystem::path& folder,
                                                       const SceneSearch& search = {});

}  // namespace pepeseg::client::cli
