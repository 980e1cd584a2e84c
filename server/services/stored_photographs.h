#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "server/api/resource_name.h"
#include "server/api/truth_frames.h"
#include "server/data/blob_store.h"
#include "server/jobs/photograph_process.h"
#include "server/store/store.h"

namespace pepeseg {

// Runs a `raw` task and returns its picture. Errors as MakePicture, and INTERNAL: the answer does
// not have the picture's size.
absl::StatusOr<Image> MakeImage(const PhotographProcess& process, const PhotographTask& task,
                                const std::filesystem::path& blob,
                                absl::FunctionRef<bool()> wanted);

// The photographs of a model's dataset. Lists the files when it is first asked. Not thread safe;
// calls block on the store, the disk and a decoder process.
class StoredPhotographs final : public ViewPhotographs {
 public:
  // All must outlive it. A decoder process is killed when `wanted` returns false.
  StoredPhotographs(Store& store, const BlobStore& blobs, const PhotographProcess& process,
                    const SceneChild& model, absl::FunctionRef<bool()> wanted)
      : store_(store), blobs_(blobs), process_(process), model_(model), wanted_(wanted) {}

  int Orientation(const ModelView& view) override;
  absl::StatusOr<Image> Upright(const ModelView& view, int max_side) override {
    return Formed(view, {.upright = true, .max_side = max_side});
  }

  // Returns the view's photograph in a form. Errors are those of Find and MakeImage.
  absl::StatusOr<Image> Formed(const ModelView& view, const PhotographForm& form);

  // Returns the record of the view's photograph. NOT_FOUND: the dataset has no such photograph.
  absl::StatusOr<DatasetFileRecord> Find(const ModelView& view);
  std::filesystem::path PathOf(const DatasetFileRecord& file) const {
    return blobs_.Path({project_, file.sha256});
  }

 private:
  absl::Status List();

  Store& store_;
  const BlobStore& blobs_;
  const PhotographProcess& process_;
  const SceneChild& model_;
  absl::FunctionRef<bool()> wanted_;
  std::string project_;
  std::optional<std::map<std::string, DatasetFileRecord>> files_;  // by PhotoKey
};

}  // namespace pepeseg
