#pragma once

#include <cstdint>
#include <fstream>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/digest.h"
#include "core/formats/gaussian_blocks.h"
#include "grpcpp/server_context.h"
#include "pepeseg/v1/render_service.pb.h"
#include "server/rpc/call_runner.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"
#include "server/services/model_loader.h"
#include "server/services/selections.h"

namespace pepeseg {

// An ExportGaussians call. The PLY file of a whole model is sent from the disk in chunks; the
// stream ends with DATA_LOSS if its digest is not that of the manifest. Any other file, of a
// subset, in another format or in other coordinates than the stored ones, is encoded twice, block
// by block: once for the size and the digest in the header, once to be sent. That holds the indices
// of the subset and one block in memory, of an SOG the whole file; they are reserved in the models'
// memory budget. A reader that does not take a message for StreamLimits::stuck_export loses the
// stream.
class ExportGaussiansStream final : public WriteStream<v1::ExportGaussiansResponse> {
 public:
  // All must outlive the stream.
  struct Dependencies {
    const CallRunner& runner;
    ModelLoader& models;
    const Selections& selections;
  };
  ExportGaussiansStream(const Dependencies& deps, grpc::CallbackServerContext* call,
                        const v1::ExportGaussiansRequest& request);

 private:
  Step Work(bool io_ok) override;
  absl::Duration io_limit() const override { return deps_.runner.streams().limits().stuck_export; }
  void CancelCall() override { call_->TryCancel(); }
  absl::Status Open();
  absl::Status OpenModel();
  // Returns false if the request means all of the model.
  absl::StatusOr<bool> OpenSubset();
  // Encodes these Gaussians; nullptr: all.
  absl::Status EncodeSubset(ResidentModel model, const GaussianSet* subset);
  // Sets subset_ to an SOG.
  absl::Status MakeSog(const ResidentModel& model, std::vector<uint32_t> indices);
  // Reserves memory for what the export holds in addition to the model: `bytes` and a chunk.
  absl::Status TakeMemory(const SceneRef& scene, int64_t bytes);
  // Digests some blocks of the subset. After the last one it fills the header.
  Step DigestSome();
  absl::Status FillChunk();
  absl::Status FillBytes(std::string& bytes);

  const Dependencies deps_;
  grpc::CallbackServerContext* const call_;
  const CallOrigin origin_;
  AuthorizedCaller caller_;
  v1::ExportGaussiansRequest request_;
  bool opened_ = false;
  std::unique_ptr<ReservedMemory> memory_;
  std::ifstream file_;                            // the PLY of a whole model
  std::optional<ResidentModel> model_;            // the subset refers to it
  std::unique_ptr<const GaussianBlocks> subset_;  // the file of a subset
  int64_t num_digested_ = 0;  // number of blocks of the subset that are digested
  int64_t next_block_ = 0;    // the block of the subset to send next
  Sha256 digest_;
  std::string sha256_;  // the digest of a whole model in its manifest
  int64_t num_bytes_left_ = 0;
};

}  // namespace pepeseg
