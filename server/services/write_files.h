#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "pepeseg/v1/dataset_service.pb.h"
#include "server/api/resource_name.h"
#include "server/data/blob_store.h"
#include "server/rpc/call_runner.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"
#include "server/services/upload_files.h"

namespace pepeseg {

// A WriteFiles call: takes one message at a time from the wire to the disk. Nothing is read before
// the caller is authorised. Complete files are committed in groups (WriteGroup): when a group is
// due, and when the stream ends, however it ends.
class WriteFilesStream final : public ReadStream<v1::WriteFilesRequest> {
 public:
  // All must outlive the stream.
  struct Dependencies {
    const CallRunner& runner;
    Store& store;
    BlobStore& blobs;
  };
  WriteFilesStream(const Dependencies& deps, CallOrigin origin, v1::WriteFilesResponse* response)
      : ReadStream(&deps.runner.streams(), &deps.runner.pools().upload),
        deps_(deps),
        origin_(std::move(origin)),
        response_(response) {}

 private:
  Step Work(bool io_ok) override;
  absl::Duration io_limit() const override;
  // Checks key and scope of the caller, before anything is read.
  absl::Status BeginCall();
  // Authorises a header, which names an upload; other parts need no authorisation.
  absl::Status Authorize(const v1::WriteFilesRequest& part);
  // Keeps what was received before the call was cut off. That blocks, so a task does it.
  void OnClosed() override;
  // Commits what was received, and records in the audit log what ended the stream.
  Step End(absl::Status status);
  // Records in the audit log how the upload of the newest header ended, unless that was done.
  void RecordEnd(const absl::Status& status);
  // Hashes the bytes that are there of a file that is resumed, a part per task.
  Step Rehash();
  absl::Status Take(const v1::WriteFilesRequest& part);
  absl::Status BeginFile(const v1::WriteFilesRequest::Header& header);
  // Finds the record of the header's file and sets `file_` and `upload_`.
  absl::Status FindFile(const v1::WriteFilesRequest::Header& header, const SceneChild& upload);
  // Reads the records of the upload's files from `path` on. `name`: the upload's, for messages.
  // FAILED_PRECONDITION: the upload is sealed.
  absl::Status ListFrom(const std::string& path, const std::string& name, const SceneChild& upload);
  absl::Status StartAt(const v1::WriteFilesRequest::Header& header);
  absl::Status TakeChunk(const std::string& chunk);
  absl::Status EndFile();

  const Dependencies deps_;
  const CallOrigin origin_;
  v1::WriteFilesResponse* const response_;
  std::optional<AuthorizedCaller> caller_;  // none: the call has not begun
  bool got_message_ = false;
  v1::WriteFilesRequest named_;  // the newest header, for the audit log
  std::string begun_;            // its upload in the audit log; empty: has its outcome, or none
  // The file that is being received. Its writer is null if the bytes are stored already.
  bool in_file_ = false;
  DatasetFileRecord file_;
  int64_t file_bytes_ = 0;       // bytes of the file that are there, from its start
  int64_t sent_bytes_ = 0;       // bytes of the file that came on this stream
  int64_t unchecked_bytes_ = 0;  // bytes since the upload was last found in the store
  std::shared_ptr<BlobWriter> writer_;
  // The upload to which the newest header belongs.
  UploadName upload_;
  std::map<std::string, DatasetFileRecord> listed_;  // the records of some of its files, by path
  WriteGroup group_;  // its complete files that are not committed yet
};

}  // namespace pepeseg
