#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "pepeseg/v1/dataset_service.pb.h"
#include "server/api/resource_name.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"
#include "server/services/write_group.h"

namespace pepeseg {

// A WriteFiles call: takes one message at a time from the wire to the disk. Begins with Work(),
// which reads nothing before it knows the caller. Files that have ended are committed in groups:
// when one is due, and where the stream ends, however it ends.
class WriteFilesStream final : public ReadStream<v1::WriteFilesRequest> {
 public:
  WriteFilesStream(const ServiceContext& context, CallOrigin origin,
                   v1::WriteFilesResponse* response)
      : ReadStream(context.streams, context.upload_pool),
        context_(context),
        origin_(std::move(origin)),
        response_(response) {}

 private:
  Step Work(bool io_ok) override;
  absl::Duration io_limit() const override;
  // Key and scope, before anything is read.
  absl::Status BeginCall();
  // Of each header, which names an upload.
  absl::Status Authorize(v1::WriteFilesRequest& part);
  // What came before the call was cut off is kept, which blocks: not in the reaction.
  void OnClosed() override;
  // Writes down what ended it, unless all went well.
  Step End(absl::Status status);
  // Hashes what is there of a file that goes on, a part at a time.
  Step Rehash();
  absl::Status Take(const v1::WriteFilesRequest& part);
  absl::Status BeginFile(const v1::WriteFilesRequest::Header& header);
  // Of the header: its row, which is kept for a while, and the upload's name.
  absl::Status FindFile(const v1::WriteFilesRequest::Header& header, const SceneChild& upload);
  // Reads the rows of the files from `path` on. `name`: the upload's. FAILED_PRECONDITION: sealed.
  absl::Status ListFrom(const std::string& path, const std::string& name, const SceneChild& upload);
  absl::Status StartAt(const v1::WriteFilesRequest::Header& header);
  absl::Status TakeChunk(const v1::WriteFilesRequest::Chunk& chunk);
  absl::Status EndFile();

  const ServiceContext context_;
  const CallOrigin origin_;
  v1::WriteFilesResponse* const response_;
  std::optional<Caller> caller_;  // none: the call has not begun
  bool got_message_ = false;
  v1::WriteFilesRequest named_;  // the newest header, for the audit log
  // The file on its way; its writer is null when the bytes are stored already.
  bool in_file_ = false;
  DatasetFileRow file_;
  int64_t file_bytes_ = 0;       // from the file's begin
  int64_t sent_bytes_ = 0;       // of the file on this stream
  int64_t unchecked_bytes_ = 0;  // since the upload was last seen to be there
  std::shared_ptr<BlobWriter> writer_;
  // Of the upload to which the newest header belongs.
  UploadName upload_;
  std::map<std::string, DatasetFileRow> listed_;  // some of its files, by path
  WriteGroup group_;                              // its ended files that are not committed yet
};

}  // namespace pepeseg
