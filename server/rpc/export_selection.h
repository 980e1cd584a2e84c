#pragma once

#include <fstream>
#include <string>

#include "core/io/digest.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"

namespace pepeseg {

// An ExportSelection call: a model's PLY from the disk to the wire, a chunk at a time.
// DATA_LOSS at its end when it is not what the manifest lists.
class ExportSelectionStream final : public WriteStream<v1::ExportSelectionResponse> {
 public:
  ExportSelectionStream(const ServiceContext& context, const v1::ExportSelectionRequest& request)
      : WriteStream(context.streams, context.pool), context_(context), request_(request) {}

 private:
  Step Work(bool io_ok) override;
  absl::Status Open();
  absl::Status FillChunk();

  const ServiceContext context_;
  const v1::ExportSelectionRequest request_;
  bool opened_ = false;
  std::ifstream file_;
  Sha256 digest_;
  std::string sha256_;  // what the model's manifest says
  int64_t num_bytes_left_ = 0;
};

}  // namespace pepeseg
