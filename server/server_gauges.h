#pragma once

#include <prometheus/collectable.h>

#include <vector>

#include "server/observe/sample.h"
#include "server/services/operations.h"

namespace pepeseg {

// What Prometheus reads of a server: read when it asks, so that nothing runs while nobody does.
// Blocks on the store.
class ServerGauges final : public prometheus::Collectable {
 public:
  explicit ServerGauges(const Operations& operations) : operations_(operations) {}

  std::vector<prometheus::MetricFamily> Collect() const override;

 private:
  void AddServer(Samples& samples) const;
  void AddPools(Samples& samples) const;
  void AddRows(Samples& samples) const;
  void AddModels(Samples& samples) const;
  void AddProcess(Samples& samples) const;

  const Operations& operations_;
};

}  // namespace pepeseg
