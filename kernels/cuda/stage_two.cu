#include "kernels/cuda/cuda_backend.h"

// The steps of stage two are not on CUDA yet: asking for one is an error, never a silent nothing.

namespace pepeseg {

void CudaBackend::TransposeRows(const TransposeRowsArgs&) {
  const Turn turn(*this);
  Fail("TransposeRows is not on CUDA yet: train the features on the CPU");
}
void CudaBackend::FeatureCatchUp(const FeatureCatchUpArgs&) {
  const Turn turn(*this);
  Fail("FeatureCatchUp is not on CUDA yet: train the features on the CPU");
}
void CudaBackend::FeatureRows(const FeatureRowsArgs&) {
  const Turn turn(*this);
  Fail("FeatureRows is not on CUDA yet: train the features on the CPU");
}
void CudaBackend::PairLoss(const PairLossArgs&) {
  const Turn turn(*this);
  Fail("PairLoss is not on CUDA yet: train the features on the CPU");
}
void CudaBackend::FeatureUpdate(const FeatureUpdateArgs&) {
  const Turn turn(*this);
  Fail("FeatureUpdate is not on CUDA yet: train the features on the CPU");
}

}  // namespace pepeseg
