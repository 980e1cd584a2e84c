#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/edit/edited_model.h"
#include "core/edit/fill_hole.h"
#include "pepeseg/v1/edit_service.pb.h"
#include "server/access/authorizer.h"
#include "server/rpc/call_runner.h"
#include "server/rpc/stream.h"
#include "server/services/model_loader.h"
#include "server/services/selections.h"

namespace pepeseg {

// An EditModel call, on the pool `correction`: edits a model in memory, stores the result as a new
// model of the scene and loads it. A hole is filled in parts, between which progress is sent; the
// work ends when the call is cancelled. The device of the model is used for moments only, so that
// queries are answered meanwhile.
class EditModelStream final : public WriteStream<v1::EditModelResponse> {
 public:
  // All must outlive the stream.
  struct Dependencies {
    const CallRunner& runner;
    ModelLoader& models;
    Selections& selections;
  };
  EditModelStream(const Dependencies& deps, grpc::CallbackServerContext* call,
                  const v1::EditModelRequest& request);

 private:
  Step Work(bool io_ok) override;
  absl::Duration io_limit() const override { return deps_.runner.streams().limits().stuck_export; }
  void CancelCall() override { call_->TryCancel(); }
  // Records in the audit log what became of a call that was cut off. That blocks, so a task does
  // it.
  void OnClosed() override;
  // Authorises the call, loads the model and begins the edit, or makes it where it takes moments.
  absl::Status Open();
  absl::StatusOr<EditedModel> Edit(const GaussianSet& subset) const;
  // Stores the result and fills the response.
  absl::Status Store(EditedModel edited);
  absl::Status RecordEnd(absl::Status status);
  Step End(absl::Status status) { return {Next::kEnd, RecordEnd(std::move(status))}; }

  const Dependencies deps_;
  grpc::CallbackServerContext* const call_;
  const CallOrigin origin_;
  const v1::EditModelRequest request_;
  std::optional<AuthorizedCaller> caller_;  // absent: the call is not authorised yet
  std::string begun_;                       // of the audit log; empty: nothing to record
  Stopwatch stopwatch_;
  v1::QueryTiming timing_;
  ResidentModel model_;
  std::unique_ptr<ReservedMemory> memory_;
  std::unique_ptr<HoleFill> fill_;  // refers to the model
  absl::Time last_progress_ = absl::InfinitePast();
  bool answered_ = false;  // the result is made
};

}  // namespace pepeseg
