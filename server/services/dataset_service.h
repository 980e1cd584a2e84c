#pragma once

#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "server/rpc/service_context.h"
#include "server/services/get_photograph.h"

namespace pepeseg {

class DatasetServiceRpc final : public v1::DatasetService::CallbackService {
 public:
  DatasetServiceRpc(const ServiceContext& context, const PhotographDecoders& decoders)
      : context_(context), decoders_(decoders) {}

  grpc::ServerUnaryReactor* CreateUpload(grpc::CallbackServerContext* call,
                                         const v1::CreateUploadRequest* request,
                                         v1::Upload* response) override;
  grpc::ServerUnaryReactor* GetUpload(grpc::CallbackServerContext* call,
                                      const v1::GetUploadRequest* request,
                                      v1::Upload* response) override;
  grpc::ServerReadReactor<v1::WriteFilesRequest>* WriteFiles(
      grpc::CallbackServerContext* call, v1::WriteFilesResponse* response) override;
  grpc::ServerUnaryReactor* SealUpload(grpc::CallbackServerContext* call,
                                       const v1::SealUploadRequest* request,
                                       v1::Dataset* response) override;
  grpc::ServerUnaryReactor* ListDatasets(grpc::CallbackServerContext* call,
                                         const v1::ListDatasetsRequest* request,
                                         v1::ListDatasetsResponse* response) override;
  grpc::ServerWriteReactor<v1::GetPhotographResponse>* GetPhotograph(
      grpc::CallbackServerContext* call, const v1::GetPhotographRequest* request) override;

 private:
  absl::Status Create(const v1::CreateUploadRequest& request, v1::Upload* response) const;
  // As ToProto, with its advice.
  absl::Status FillDataset(const DatasetRow& row, v1::Dataset* dataset) const;
  absl::Status FillUpload(const DatasetRow& row, v1::Upload* upload) const;
  absl::Status Seal(const v1::SealUploadRequest& request, v1::Dataset* response) const;

  const ServiceContext context_;
  const PhotographDecoders decoders_;
};

}  // namespace pepeseg
