#include "server/services/dataset_service.h"

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/mask_advice.h"
#include "server/api/records_to_proto.h"
#include "server/api/resource_name.h"
#include "server/services/file_header.h"
#include "server/services/upload_files.h"
#include "server/services/upload_rules.h"
#include "server/services/write_files.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

// Writes what a dataset consists of, so that the data directory can be read without the database.
absl::Status WriteDatasetManifest(const std::filesystem::path& data_folder,
                                  const DatasetRecord& record,
                                  const std::vector<DatasetFileRecord>& files) {
  nlohmann::json manifest = {{"version", 1},
                             {"dataset", ChildName(record.scene, "datasets", record.number)},
                             {"files", nlohmann::json::array()}};
  for (const DatasetFileRecord& file : files) {
    manifest["files"].push_back({{"path", file.path},
                                 {"kind", v1::FileKind_Name(static_cast<v1::FileKind>(file.kind))},
                                 {"size", file.size},
                                 {"sha256", file.sha256}});
  }
  const auto path = DatasetManifestPath(data_folder, record.scene, record.number);
  std::error_code error;
  std::filesystem::create_directories(path.parent_path(), error);
  if (error) return FileError(path.parent_path(), "cannot make the folder", error.value());
  return WriteFileAtomically(path, manifest.dump(1));
}

// Sets `stored` of the files whose bytes the project has.
void FindStored(const BlobStore& blobs, const std::string& project,
                std::vector<DatasetFileRecord>& files) {
  for (DatasetFileRecord& file : files) file.stored = blobs.Has({project, file.sha256}, file.size);
}

// Returns FAILED_PRECONDITION unless the project has the bytes of all files. Adds to `found` the
// files whose records do not say so yet: the bytes may have been uploaded under another path, or
// for another dataset.
absl::Status FindFiles(const BlobStore& blobs, const std::string& project,
                       const std::vector<DatasetFileRecord>& files,
                       std::vector<DatasetFileRecord>& found) {
  const DatasetFileRecord* first = nullptr;
  int64_t num_missing = 0;
  for (const DatasetFileRecord& file : files) {
    if (!blobs.Has({project, file.sha256}, file.size)) {
      if (num_missing++ == 0) first = &file;
    } else if (!file.stored) {
      found.push_back(file);
    }
  }
  if (first == nullptr) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(num_missing, " of ", files.size(),
                                                    " files are not uploaded, the first is '",
                                                    first->path, "'"));
}

// Returns a check, for Store::CreateDataset, whether the disk has room for the files that are not
// stored. Others may fill the disk later: then writing the files fails, and can be resumed.
absl::StatusOr<std::function<absl::Status()>> CheckRoom(
    const BlobStore& blobs, const std::vector<DatasetFileRecord>& files) {
  std::map<std::string, int64_t> missing;
  for (const DatasetFileRecord& file : files) {
    if (!file.stored) missing[file.sha256] = file.size;
  }
  int64_t need = 0;
  // By digest: files with the same bytes are stored once.
  for (const auto& [digest, size] : missing) need += size;
  ASSIGN_OR_RETURN(const int64_t have, blobs.FreeBytes());
  return [need, have] {
    if (need <= have) return absl::OkStatus();
    return WithDetail(
        absl::ResourceExhaustedError(
            absl::StrCat("the upload needs ", need, " bytes, the server's disk has ", have)),
        {.reason = kDiskFull, .limit = absl::StrCat(have), .value = absl::StrCat(need)});
  };
}

}  // namespace

DatasetServiceRpc::DatasetServiceRpc(const CallRunner& runner, const ModelLoader& models,
                                     BlobStore& blobs, const Dependencies& deps)
    : runner_(runner), models_(models), store_(models.store()), blobs_(blobs), deps_(deps) {}

absl::Status DatasetServiceRpc::FillUpload(const DatasetRecord& record, v1::Upload* upload) const {
  upload->set_name(ChildName(record.scene, "uploads", record.number));
  *upload->mutable_create_time() = ToProto(record.create_time);
  upload->set_num_files(record.num_files);
  upload->set_num_bytes(record.num_bytes);
  upload->set_sealed(record.state == DatasetState::kSealed);
  if (upload->sealed()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const auto files, store_.files().ListDatasetFiles(record.scene, record.number));
  const std::string& project = record.scene.project;
  const auto partial = blobs_.ListPartial({record.scene, record.number});
  for (const DatasetFileRecord& file : files) {
    // The disk is asked, not the record: the bytes may have come with another upload, and a client
    // must not send them twice.
    if (blobs_.Has({project, file.sha256}, file.size)) continue;
    upload->add_missing_files(file.path);
    const auto found = partial.find(file.sha256);
    if (found == partial.end()) continue;
    auto& partial_file = *upload->add_partial_files();
    partial_file.set_path(file.path);
    partial_file.set_committed_bytes(found->second);
  }
  return absl::OkStatus();
}

absl::Status DatasetServiceRpc::FillDataset(const DatasetRecord& record,
                                            v1::Dataset* dataset) const {
  *dataset = ToProto(record);
  ASSIGN_OR_RETURN(bool has_masks,
                   store_.files().HasFileOfKind(record.scene, record.number, v1::FILE_KIND_MASK));
  // No advice is needed where the server makes masks.
  if (has_masks && !deps_.has_mask_maker) {
    ASSIGN_OR_RETURN(const auto files,
                     store_.files().ListDatasetFiles(record.scene, record.number));
    has_masks = CountSegmentMasks(blobs_, record.scene.project, files) > 0;
  }
  for (std::string& advice : AdviceOnDataset(has_masks, deps_.has_mask_maker)) {
    dataset->add_advice(std::move(advice));
  }
  return absl::OkStatus();
}

absl::Status DatasetServiceRpc::CreateUpload(const UnaryCall& call,
                                             const v1::CreateUploadRequest& request,
                                             v1::Upload* response) const {
  ASSIGN_OR_RETURN(const SceneRef scene, call.scenes().Scene(request.parent(), "parent"));
  RETURN_IF_ERROR(CheckRequestId(request.request_id()));
  ASSIGN_OR_RETURN(auto files, CheckUploadFiles(request));
  // A stored blob that this upload names need not be sent. The lock keeps the collector from
  // removing it, if nothing else refers to it, before the record is there.
  ASSIGN_OR_RETURN(const LockedFile hold, blobs_.Hold(scene.project));
  FindStored(blobs_, scene.project, files);
  ASSIGN_OR_RETURN(const auto admit, CheckRoom(blobs_, files));
  const auto record = store_.datasets().CreateDataset(scene, request.request_id(), files, admit);
  if (!record.ok()) return WithResource(record.status(), "", request.parent());
  return FillUpload(*record, response);
}

absl::Status DatasetServiceRpc::GetUpload(const UnaryCall& call,
                                          const v1::GetUploadRequest& request,
                                          v1::Upload* response) const {
  ASSIGN_OR_RETURN(const SceneChild upload, call.scenes().Child(request.name(), "uploads", "name"));
  const auto record = store_.datasets().GetDataset(upload.scene, upload.number);
  if (!record.ok()) return WithResource(record.status(), "NO_SUCH_UPLOAD", request.name());
  return FillUpload(*record, response);
}

absl::Status DatasetServiceRpc::DeleteUpload(const UnaryCall& call,
                                             const v1::DeleteUploadRequest& request,
                                             google::protobuf::Empty* /*response*/) const {
  ASSIGN_OR_RETURN(const SceneChild upload, call.scenes().Child(request.name(), "uploads", "name"));
  const absl::Status deleted = pepeseg::DeleteUpload(store_, blobs_, {upload.scene, upload.number});
  return WithResource(deleted, absl::IsNotFound(deleted) ? "NO_SUCH_UPLOAD" : "SEALED",
                      request.name());
}

grpc::ServerReadReactor<v1::WriteFilesRequest>* DatasetServiceRpc::WriteFiles(
    grpc::CallbackServerContext* call, v1::WriteFilesResponse* response) {
  const auto stream = std::make_shared<WriteFilesStream>(
      WriteFilesStream::Dependencies{runner_, store_, blobs_}, OriginOf(*call), response);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

absl::Status DatasetServiceRpc::SealUpload(const UnaryCall& call,
                                           const v1::SealUploadRequest& request,
                                           v1::Dataset* response) const {
  ASSIGN_OR_RETURN(const SceneChild upload, call.scenes().Child(request.name(), "uploads", "name"));
  Store& store = store_;
  ASSIGN_OR_RETURN(DatasetRecord record, store.datasets().GetDataset(upload.scene, upload.number));
  // Sealing a sealed upload returns it, so that a client may retry.
  if (record.state == DatasetState::kOpen) {
    ASSIGN_OR_RETURN(auto files, store.files().ListDatasetFiles(upload.scene, upload.number));
    std::vector<DatasetFileRecord> found;
    const absl::Status complete = FindFiles(blobs_, upload.scene.project, files, found);
    if (!complete.ok()) return WithResource(complete, "FILES_MISSING", request.name());
    // Before the record: a crash in between leaves a manifest that the next SealUpload writes
    // again, and no sealed dataset is without one.
    RETURN_IF_ERROR(WriteDatasetManifest(models_.data_folder(), record, files));
    const auto sealed = store.datasets().SealDataset(upload.scene, upload.number, found);
    if (!sealed.ok()) return WithResource(sealed.status(), "FILES_MISSING", request.name());
    // Partial files whose bytes another upload has brought.
    blobs_.RemovePartial({upload.scene, upload.number});
    record = *sealed;
  }
  return FillDataset(record, response);
}

absl::Status DatasetServiceRpc::GetDataset(const UnaryCall& call,
                                           const v1::GetDatasetRequest& request,
                                           v1::Dataset* response) const {
  ASSIGN_OR_RETURN(const SceneChild dataset,
                   call.scenes().Child(request.name(), "datasets", "name"));
  auto record = store_.datasets().GetDataset(dataset.scene, dataset.number);
  // An upload that is not sealed has the number of the dataset that it may become.
  if (record.ok() && record->state != DatasetState::kSealed) {
    record = absl::NotFoundError(absl::StrCat(request.name(), " is not sealed yet"));
  }
  if (!record.ok()) return WithResource(record.status(), "NO_SUCH_DATASET", request.name());
  return FillDataset(*record, response);
}

absl::Status DatasetServiceRpc::ListDatasets(const UnaryCall& call,
                                             const v1::ListDatasetsRequest& request,
                                             v1::ListDatasetsResponse* response) const {
  ASSIGN_OR_RETURN(const SceneRef scene, call.scenes().Scene(request.parent(), "parent"));
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const Page<DatasetRecord> datasets, store_.datasets().ListDatasets(scene, page));
  for (const DatasetRecord& record : datasets.records) {
    // The store lists sealed datasets only; this keeps the answer right if that changes.
    if (record.state != DatasetState::kSealed) continue;
    RETURN_IF_ERROR(FillDataset(record, response->add_datasets()));
  }
  response->set_next_page_token(datasets.next_page_token);
  return absl::OkStatus();
}

grpc::ServerWriteReactor<v1::GetPhotographResponse>* DatasetServiceRpc::GetPhotograph(
    grpc::CallbackServerContext* call, const v1::GetPhotographRequest* request) {
  const auto stream = std::make_shared<GetPhotographStream>(
      GetPhotographStream::Dependencies{runner_, models_, blobs_, deps_.decoders}, call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
