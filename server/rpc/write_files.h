#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "pepeseg/v1/dataset_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"

namespace pepeseg {

// A WriteFiles call: takes one message at a time from the wire to the disk.
class WriteFilesStream final : public ReadStream<v1::WriteFilesRequest> {
 public:
  WriteFilesStream(const ServiceContext& context, CallOrigin origin,
                   v1::WriteFilesResponse* response)
      : ReadStream(context.streams, context.pool),
        context_(context),
        origin_(std::move(origin)),
        response_(response) {}

 private:
  Step Work(bool io_ok) override;
  // Of the first message, whatever it is, and of each header, which names an upload.
  absl::Status Authorize(const v1::WriteFilesRequest& part);
  // What came before the call was cut off is kept, which blocks: not in the reaction.
  void OnClosed() override;
  // Writes down what ended it, unless all went well.
  Step End(absl::Status status);
  // Hashes what is there of a file that goes on, a part at a time.
  Step Rehash();
  absl::Status Take(const v1::WriteFilesRequest& part);
  absl::Status BeginFile(const v1::WriteFilesRequest::Header& header);
  absl::Status StartAt(const v1::WriteFilesRequest::Header& header);
  absl::Status TakeChunk(const v1::WriteFilesRequest::Chunk& chunk);
  absl::Status EndFile();

  const ServiceContext context_;
  const CallOrigin origin_;
  v1::WriteFilesResponse* const response_;
  std::optional<Caller> caller_;
  v1::WriteFilesRequest named_;  // the newest header, for the audit log
  // The file on its way; its writer is null when the bytes are stored already.
  bool in_file_ = false;
  std::string scene_;
  int64_t dataset_ = 0;
  DatasetFileRow file_;
  int64_t file_bytes_ = 0;  // from the file's begin
  int64_t sent_bytes_ = 0;  // of the file on this stream
  std::shared_ptr<BlobWriter> writer_;
};

}  // namespace pepeseg
