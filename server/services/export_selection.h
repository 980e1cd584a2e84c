#pragma once

#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "core/base/digest.h"
#include "core/formats/gaussian_ply.h"
#include "grpcpp/server_context.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"
#include "server/services/model_lookup.h"

namespace pepeseg {

// An ExportSelection call. A whole model's PLY goes from the disk to the wire, a chunk at a time;
// DATA_LOSS at its end when it is not what the manifest lists. A subset's PLY is encoded twice, a
// block at a time: for the size and digest in the header, then for the wire. It holds the indices
// of the subset and one block, which are taken from the models' memory budget, and a reader that
// does not take a message for StreamLimits::stuck_export loses the stream.
class ExportSelectionStream final : public WriteStream<v1::ExportSelectionResponse> {
 public:
  ExportSelectionStream(const ServiceContext& context, grpc::CallbackServerContext* call,
                        const v1::ExportSelectionRequest& request)
      : WriteStream(context.streams, request.has_subset() ? context.query_pool : context.pool),
        context_(context),
        call_(call),
        origin_(OriginOf(*call)),
        request_(request) {}

 private:
  Step Work(bool io_ok) override;
  absl::Duration io_limit() const override { return context_.streams->limits().stuck_export; }
  void CancelCall() override { call_->TryCancel(); }
  absl::Status Open();
  absl::Status OpenModel();
  // False: the request means all of the model.
  absl::StatusOr<bool> OpenSubset();
  // Takes memory for what the export holds besides the model, `bytes` and a chunk.
  absl::Status TakeMemory(const std::string& scene, int64_t bytes);
  // Digests some blocks of the subset; fills the header after the last one.
  Step DigestSome();
  absl::Status FillChunk();
  absl::Status FillBytes(std::string& bytes);

  const ServiceContext context_;
  grpc::CallbackServerContext* const call_;
  const CallOrigin origin_;
  v1::ExportSelectionRequest request_;  // with keys, once it is authorised
  bool opened_ = false;
  std::unique_ptr<ReservedMemory> memory_;
  std::ifstream file_;                       // of the whole model
  std::optional<ResidentModel> model_;       // of the subset, which refers to it
  std::optional<GaussianPlyBlocks> subset_;  // some of the model
  int64_t num_digested_ = 0;                 // blocks of the subset
  int64_t next_block_ = 0;                   // of the subset, to be sent
  Sha256 digest_;
  std::string sha256_;  // what it shall be
  int64_t num_bytes_left_ = 0;
};

}  // namespace pepeseg
