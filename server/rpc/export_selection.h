#pragma once

#include <fstream>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "core/io/digest.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"

namespace pepeseg {

// An ExportSelection call: a model's PLY from the disk to the wire, a chunk at a time; DATA_LOSS at
// its end when it is not what the manifest lists. A subset's PLY is made in memory first.
class ExportSelectionStream final : public WriteStream<v1::ExportSelectionResponse> {
 public:
  ExportSelectionStream(const ServiceContext& context, CallOrigin origin,
                        const v1::ExportSelectionRequest& request)
      : WriteStream(context.streams, request.has_subset() ? context.query_pool : context.pool),
        context_(context),
        origin_(std::move(origin)),
        request_(request) {}

 private:
  Step Work(bool io_ok) override;
  absl::Status Open();
  absl::Status OpenModel();
  // False: the request means all of the model.
  absl::StatusOr<bool> MakeSubset();
  absl::Status FillChunk();

  const ServiceContext context_;
  const CallOrigin origin_;
  const v1::ExportSelectionRequest request_;
  bool opened_ = false;
  std::ifstream file_;  // of the whole model
  std::string subset_;  // the PLY of some of it
  Sha256 digest_;
  std::string sha256_;  // what it shall be
  int64_t num_bytes_left_ = 0;
};

}  // namespace pepeseg
