#pragma once

#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/digest.h"
#include "core/query/scene_model.h"
#include "pepeseg/v1/selection_service.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/selections.h"
#include "server/services/view_images.h"

namespace pepeseg {

// What selections are made with. All must outlive them.
struct SelectionTools {
  ModelLoader& models;
  ViewImages& images;
  Selections& selections;
};

// The selection that a CreateSelectionRequest makes. Holds the model in memory.
class NewSelection {
 public:
  // Loads the model, which blocks, and reads the request, which must outlive the selection. A
  // repeated request is answered from its record, before the model is loaded: "live" may mean a
  // newer model by now.
  static absl::StatusOr<std::unique_ptr<NewSelection>> Begin(
      const SelectionTools& tools, const UnaryCall& call,
      const v1::CreateSelectionRequest& request);

  // Returns whether SAM helps, which takes longer than other queries.
  bool asks_sam() const { return images_ != nullptr; }
  // Selects, records the selection and fills the response. Blocks.
  absl::Status Make(v1::Selection* response);

 private:
  NewSelection(const SelectionTools& tools, const UnaryRequest& call,
               const v1::CreateSelectionRequest& request)
      : tools_(tools), call_(call), request_(request) {}
  absl::Status Read(const NamedScenes& scenes);
  absl::Status ReadPrompt();
  absl::StatusOr<GaussianSet> Select();

  const SelectionTools tools_;
  const UnaryRequest call_;
  const v1::CreateSelectionRequest& request_;
  bool is_earlier_ = false;  // the record is that of an earlier request
  SelectionRecord record_;
  ResidentModel model_;
  GaussianSet base_;
  SelectRequest asked_;                     // of a prompt
  std::unique_ptr<ImageSegmenter> images_;  // refers to the model; null: SAM is not asked
};

// Helpers of requests that make selections.

v1::SetOperation OperationOr(v1::SetOperation operation, v1::SetOperation by_default);
absl::Status CheckOperation(v1::SetOperation operation);
// Returns `added` for REPLACE.
absl::StatusOr<GaussianSet> Combine(v1::SetOperation operation, const GaussianSet& base,
                                    const GaussianSet& added);

// Sets request_id, and the digest by which a repeated request is recognised: of all other fields,
// and of the type, since requests of two types may have the same bytes.
template <typename Request>
void SetRequest(Request request, SelectionRecord& record) {
  record.request_id = request.request_id();
  request.clear_request_id();
  // The bytes of a serialised message are the same within one version of the program, which
  // suffices for retries.
  record.request_digest = Sha256Hex(request.GetTypeName() + "\n" + request.SerializeAsString());
}

}  // namespace pepeseg
