#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/annotations/annotation_writer.h"
#include "core/annotations/things_table.h"
#include "core/formats/zip_writer.h"
#include "grpcpp/server_context.h"
#include "pepeseg/v1/label_service.pb.h"
#include "server/rpc/call_runner.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"
#include "server/services/annotated_views.h"
#include "server/services/model_loader.h"
#include "server/services/segment_answer.h"

namespace pepeseg {

// An ExportAnnotations call, on the pool `evaluation`. Finds the masks of one view at a time,
// between which the pool turns to others, makes the zip in memory that is reserved in the models'
// memory budget as it grows, and then sends it. The work ends when the call is cancelled. A reader
// that does not take a message for StreamLimits::stuck_export loses the stream.
class ExportAnnotationsStream final : public WriteStream<v1::ExportAnnotationsResponse> {
 public:
  // All must outlive the stream.
  struct Dependencies {
    const CallRunner& runner;
    ModelLoader& models;
    SegmentTools tools;
  };
  ExportAnnotationsStream(const Dependencies& deps, grpc::CallbackServerContext* call,
                          const v1::ExportAnnotationsRequest& request);

 private:
  Step Work(bool io_ok) override;
  absl::Duration io_limit() const override { return deps_.runner.streams().limits().stuck_export; }
  void CancelCall() override { call_->TryCancel(); }
  absl::Status Open();
  // Finds masks, and adds what has become complete to the zip. Returns true if there is progress to
  // report.
  absl::StatusOr<bool> FindSome();
  // Ends the zip and fills the header.
  absl::Status Finish();
  // Reserves memory for what the zip takes by now.
  absl::Status Reserve();
  // Returns the step after work that is not reported.
  Step Continue();

  const Dependencies deps_;
  grpc::CallbackServerContext* const call_;
  const CallOrigin origin_;
  AuthorizedCaller caller_;
  const v1::ExportAnnotationsRequest request_;
  // The writer refers to the zip and the scene of the views, as the table does.
  std::unique_ptr<AnnotatedViews> views_;
  ZipWriter zip_;
  std::unique_ptr<AnnotationWriter> writer_;
  std::optional<ThingsTable> table_;       // absent: not wanted
  std::vector<ThingGaussians> gaussians_;  // of the things so far, for the table
  std::vector<std::unique_ptr<ReservedMemory>> memory_;
  int64_t num_reserved_ = 0;         // bytes
  std::optional<std::string> file_;  // absent: not made yet
  size_t num_sent_ = 0;              // bytes
};

}  // namespace pepeseg
