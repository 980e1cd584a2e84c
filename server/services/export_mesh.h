#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/formats/mesh_blocks.h"
#include "grpcpp/server_context.h"
#include "pepeseg/v1/render_service.pb.h"
#include "server/rpc/call_runner.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"
#include "server/services/model_loader.h"
#include "server/services/selections.h"

namespace pepeseg {

// An ExportMesh call, on the pool `evaluation`. Makes the mesh, in memory that is reserved in the
// models' memory budget, and then sends it block by block. The work ends at the next view when the
// call is cancelled. A reader that does not take a message for StreamLimits::stuck_export loses the
// stream.
class ExportMeshStream final : public WriteStream<v1::ExportMeshResponse> {
 public:
  // All must outlive the stream.
  struct Dependencies {
    const CallRunner& runner;
    ModelLoader& models;
    const Selections& selections;
  };
  ExportMeshStream(const Dependencies& deps, grpc::CallbackServerContext* call,
                   const v1::ExportMeshRequest& request);

 private:
  Step Work(bool io_ok) override;
  absl::Duration io_limit() const override { return deps_.runner.streams().limits().stuck_export; }
  void CancelCall() override { call_->TryCancel(); }
  absl::Status Open();
  // Fills the header and `blocks_`.
  absl::Status Make(const ResidentModel& model, const GaussianSet* subset);

  const Dependencies deps_;
  grpc::CallbackServerContext* const call_;
  const CallOrigin origin_;
  AuthorizedCaller caller_;
  v1::ExportMeshRequest request_;
  std::unique_ptr<ReservedMemory> memory_;
  std::unique_ptr<const MeshBlocks> blocks_;
  int64_t next_block_ = 0;
};

}  // namespace pepeseg
