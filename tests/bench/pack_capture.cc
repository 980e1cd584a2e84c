// Developer program: imports a dataset folder, or makes a development scene, and writes it with its
// ground truth as a capture pack.
#include <CLI/CLI.hpp>
#include <iostream>
#include <string>
#include <utility>

#include "core/base/status_macros.h"
#include "core/dataset/import.h"
#include "core/priors/priors.h"
#include "tests/bench/capture_pack.h"
#include "tests/bench/truth_files.h"
#include "tests/testing/bolt_surfaces.h"
#include "tests/testing/crowded_capture.h"

namespace pepeseg {
namespace {

struct PackOptions {
  ImportOptions import;
  bool disparity = false;      // depth/ holds disparity
  EmbeddedPriors embedded;     // replace those of the dataset
  bool join_embedded = false;  // add embedded masks to those of the dataset
  bool plain = false;          // no compression
};

absl::Status Embed(const EmbeddedPriors& what, Capture& capture) {
  for (View& view : capture.views) {
    if (what.masks) view.masks = {};
    if (what.depth) view.depth = {};
  }
  return EmbedPriors(what, 0, capture, [](int, int) { return absl::OkStatus(); });
}

// Writes the levels `part` and `object`.
absl::Status PackScene(testing::CrowdedScene scene, const std::string& path,
                       const PackOptions& options) {
  CapturePack pack;
  pack.capture = std::move(scene.capture);
  RETURN_IF_ERROR(Embed(options.embedded, pack.capture));
  pack.truth = {{"part", std::move(scene.parts.entities), std::move(scene.parts.labels)},
                {"object", std::move(scene.objects.entities), std::move(scene.objects.labels)}};
  return WriteCapturePack(path, pack, !options.plain);
}

// Adds the embedded masks that do not duplicate a mask of the dataset, as training on SAM's masks
// does.
absl::Status JoinEmbedded(Capture& capture) {
  constexpr double kDuplicateIou = 0.8;
  std::vector<MaskSet> given;
  for (View& view : capture.views) given.push_back(std::exchange(view.masks, {}));
  RETURN_IF_ERROR(
      EmbedPriors({.masks = true}, 0, capture, [](int, int) { return absl::OkStatus(); }));
  for (size_t v = 0; v < given.size(); ++v) {
    View& view = capture.views[v];
    std::vector<BinaryMask> masks;
    for (int k = 0; k < given[v].num_masks; ++k) masks.push_back(given[v].Extract(k));
    for (int k = 0; k < view.masks.num_masks; ++k) masks.push_back(view.masks.Extract(k));
    view.masks = BuildMaskSet(view.camera.width, view.camera.height, masks, kDuplicateIou);
  }
  return absl::OkStatus();
}

absl::Status PackDataset(const std::string& folder, const std::string& path,
                         const PackOptions& options) {
  ASSIGN_OR_RETURN(auto files, ListDataset(folder));
  for (DatasetFile& file : files) {
    if (options.disparity && file.kind == FileKind::kDepth) file.kind = FileKind::kDisparity;
  }
  CapturePack pack;
  ASSIGN_OR_RETURN(pack.capture, ImportCapture(files, options.import));
  RETURN_IF_ERROR(Embed(options.embedded, pack.capture));
  if (options.join_embedded) RETURN_IF_ERROR(JoinEmbedded(pack.capture));
  for (const std::string& warning : pack.capture.warnings) std::cerr << warning << "\n";
  ASSIGN_OR_RETURN(pack.truth, ReadTruth(folder, pack.capture));
  for (const TruthLevel& level : pack.truth) std::cerr << "truth: " << level.name << "\n";
  return WriteCapturePack(path, pack, !options.plain);
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("A dataset folder as a capture pack");
  std::string folder, pack, crowded_pack, bolt_pack;
  pepeseg::PackOptions options;
  auto* crowded = app.add_option("--crowded", crowded_pack,
                                 "write the crowded development scene to this pack instead");
  auto* bolts =
      app.add_option("--bolts", bolt_pack, "write the scene of 20 equal bolts to this pack instead")
          ->excludes(crowded);
  app.add_option("folder", folder)->excludes(crowded)->excludes(bolts);
  app.add_option("pack", pack)->excludes(crowded)->excludes(bolts);
  app.add_flag("--disparity", options.disparity, "depth/ holds disparity");
  app.add_flag("--plain", options.plain, "no compression: larger, and fast to read");
  app.add_option("--image-scale", options.import.image_scale);
  app.add_flag("--embedded-masks", options.embedded.masks,
               "make embedded masks instead of using those of the dataset");
  app.add_flag("--join-embedded-masks", options.join_embedded,
               "add embedded masks to those of the dataset");
  app.add_flag("--embedded-depth", options.embedded.depth,
               "make embedded depth instead of using that of the dataset");
  CLI11_PARSE(app, argc, argv);
  absl::Status status;
  if (!crowded_pack.empty()) {
    status = pepeseg::PackScene(pepeseg::testing::MakeCrowdedScene(), crowded_pack, options);
  } else if (!bolt_pack.empty()) {
    status = pepeseg::PackScene(pepeseg::testing::MakeSceneOf(pepeseg::testing::MakeBoltSurfaces(),
                                                              {.width = 320, .height = 240}),
                                bolt_pack, options);
  } else if (!pack.empty()) {
    status = pepeseg::PackDataset(folder, pack, options);
  } else {
    status = absl::InvalidArgumentError("FOLDER PACK, --crowded PACK or --bolts PACK");
  }
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
