#pragma once

#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "server/data/blob_store.h"
#include "server/rpc/call_runner.h"
#include "server/services/get_photograph.h"

namespace pepeseg {

// Answers calls about uploads, datasets and their photographs.
class DatasetServiceRpc final : public v1::DatasetService::CallbackService {
 public:
  struct Dependencies {
    bool has_mask_maker = false;  // the server has SAM or a priors command
    PhotographDecoders decoders;
  };
  // All must outlive it. The blobs' records are in the store of `models`.
  DatasetServiceRpc(const CallRunner& runner, const ModelLoader& models, BlobStore& blobs,
                    const Dependencies& deps);

  PEPESEG_UNARY(CreateUpload, v1::CreateUploadRequest, v1::Upload)
  PEPESEG_UNARY(GetUpload, v1::GetUploadRequest, v1::Upload)
  PEPESEG_UNARY(DeleteUpload, v1::DeleteUploadRequest, google::protobuf::Empty)
  grpc::ServerReadReactor<v1::WriteFilesRequest>* WriteFiles(
      grpc::CallbackServerContext* call, v1::WriteFilesResponse* response) override;
  PEPESEG_UNARY(SealUpload, v1::SealUploadRequest, v1::Dataset)
  PEPESEG_UNARY(GetDataset, v1::GetDatasetRequest, v1::Dataset)
  PEPESEG_UNARY(ListDatasets, v1::ListDatasetsRequest, v1::ListDatasetsResponse)
  grpc::ServerWriteReactor<v1::GetPhotographResponse>* GetPhotograph(
      grpc::CallbackServerContext* call, const v1::GetPhotographRequest* request) override;

 private:
  // Fills in what ToProto does, and advice on masks.
  absl::Status FillDataset(const DatasetRecord& record, v1::Dataset* dataset) const;
  absl::Status FillUpload(const DatasetRecord& record, v1::Upload* upload) const;

  const CallRunner& runner_;
  const ModelLoader& models_;
  Store& store_;
  BlobStore& blobs_;
  const Dependencies deps_;
};

}  // namespace pepeseg
