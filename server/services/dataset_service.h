#pragma once

#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "server/data/blob_store.h"
#include "server/rpc/call_runner.h"
#include "server/services/get_photograph.h"

namespace pepeseg {

// Answers calls about uploads, datasets and their photographs.
class DatasetServiceRpc final : public v1::DatasetService::CallbackService {
 public:
  struct Options {
    bool has_mask_maker = false;  // the server has SAM or a priors command
    PhotographDecoders decoders;
  };
  // All must outlive it. The blobs' records are in the store of `models`.
  DatasetServiceRpc(const CallRunner& runner, const ModelLoader& models, BlobStore& blobs,
                    const Options& options);

  grpc::ServerUnaryReactor* CreateUpload(grpc::CallbackServerContext* call,
                                         const v1::CreateUploadRequest* request,
                                         v1::Upload* response) override;
  grpc::ServerUnaryReactor* GetUpload(grpc::CallbackServerContext* call,
                                      const v1::GetUploadRequest* request,
                                      v1::Upload* response) override;
  grpc::ServerUnaryReactor* DeleteUpload(grpc::CallbackServerContext* call,
                                         const v1::DeleteUploadRequest* request,
                                         google::protobuf::Empty* response) override;
  grpc::ServerReadReactor<v1::WriteFilesRequest>* WriteFiles(
      grpc::CallbackServerContext* call, v1::WriteFilesResponse* response) override;
  grpc::ServerUnaryReactor* SealUpload(grpc::CallbackServerContext* call,
                                       const v1::SealUploadRequest* request,
                                       v1::Dataset* response) override;
  grpc::ServerUnaryReactor* GetDataset(grpc::CallbackServerContext* call,
                                       const v1::GetDatasetRequest* request,
                                       v1::Dataset* response) override;
  grpc::ServerUnaryReactor* ListDatasets(grpc::CallbackServerContext* call,
                                         const v1::ListDatasetsRequest* request,
                                         v1::ListDatasetsResponse* response) override;
  grpc::ServerWriteReactor<v1::GetPhotographResponse>* GetPhotograph(
      grpc::CallbackServerContext* call, const v1::GetPhotographRequest* request) override;

 private:
  absl::Status Create(const UnaryCall& call, const v1::CreateUploadRequest& request,
                      v1::Upload* response) const;
  // Fills in what ToProto does, and advice on masks.
  absl::Status FillDataset(const DatasetRow& row, v1::Dataset* dataset) const;
  absl::Status FillUpload(const DatasetRow& row, v1::Upload* upload) const;
  absl::Status Delete(const UnaryCall& call, const v1::DeleteUploadRequest& request) const;
  absl::Status Get(const UnaryCall& call, const v1::GetDatasetRequest& request,
                   v1::Dataset* response) const;
  absl::Status Seal(const UnaryCall& call, const v1::SealUploadRequest& request,
                    v1::Dataset* response) const;

  const CallRunner& runner_;
  const ModelLoader& models_;
  Store& store_;
  BlobStore& blobs_;
  const Options options_;
};

}  // namespace pepeseg
