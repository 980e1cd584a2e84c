#pragma once

#include <memory>
#include <string>

#include "pepeseg/v1/dataset_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"

namespace pepeseg {

// A WriteFiles call: takes one message at a time from the wire to the disk.
class WriteFilesStream final : public ReadStream<v1::WriteFilesRequest> {
 public:
  WriteFilesStream(const ServiceContext& context, v1::WriteFilesResponse* response)
      : ReadStream(context.streams, context.pool), context_(context), response_(response) {}

 private:
  Step Work(bool io_ok) override;
  absl::Status Take(const v1::WriteFilesRequest& part);
  absl::Status BeginFile(const v1::WriteFilesRequest::Header& header);
  absl::Status TakeChunk(const v1::WriteFilesRequest::Chunk& chunk);
  absl::Status EndFile();

  const ServiceContext context_;
  v1::WriteFilesResponse* const response_;
  // The file on its way; its writer is null when the bytes are stored already.
  bool in_file_ = false;
  std::string scene_;
  int64_t dataset_ = 0;
  DatasetFileRow file_;
  int64_t file_bytes_ = 0;
  std::unique_ptr<BlobStore::Writer> writer_;
};

}  // namespace pepeseg
