#include "core/train/model_writing.h"

#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/errors.h"
#include "core/model_files/model_file.h"
#include "core/train/photograph_masks.h"

namespace pepeseg {

Model DescribeModel(const TrainingInputs& inputs, const Capture& capture, const Backend& backend) {
  Model model;
  for (const View& view : capture.views) {
    model.views.push_back({.name = view.name,
                           .camera = view.camera,
                           .cam_from_world = view.cam_from_world,
                           .held_out = view.held_out,
                           .photograph = view.photograph});
  }
  model.origin = capture.origin;
  model.scene_radius = SceneRadius(capture);
  model.facts = inputs.facts;
  model.facts["device"] = backend.name();
  return model;
}

void CopyFindings(const TrainingMetrics& metrics, const Sources& sources, Model& model) {
  for (const auto& [name, value] : metrics.ByName()) model.metrics[name] = value;
  for (const auto& [what, source] : ByName(sources)) model.facts[what] = source;
}

std::optional<Gaussians> FindEarlierGaussians(const TrainingFolders& folders,
                                              TrainingObserver& observer) {
  for (const std::filesystem::path& run : folders.earlier) {
    absl::StatusOr<Model> earlier = ReadModel(run / kReconstructFolder);
    if (!earlier.ok()) continue;
    observer.Log(absl::StrCat("stage one was done by ", run.filename().string()));
    return std::move(earlier->gaussians);
  }
  return std::nullopt;
}

absl::Status WriteModelTo(const std::filesystem::path& folder, const Model& model) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  return WriteModel(folder, model);
}

void KeepEmbeddings(const TrainingFolders& folders, const Capture& capture,
                    TrainingObserver& observer) {
  const int count = MoveEmbeddings(SamFolder(folders), capture.views, folders.run);
  if (count == 0) return;
  observer.Log(
      absl::StrFormat("SAM: the embeddings of %d photographs are kept with the model: "
                      "%.0f MB",
                      count, 1e-6 * static_cast<double>(count * kEmbeddingFileBytes)));
}

}  // namespace pepeseg
