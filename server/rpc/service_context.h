#pragma once

#include <cstdint>
#include <filesystem>

#include "core/query/segmenter.h"
#include "server/access/authorizer.h"
#include "server/access/project_quotas.h"
#include "server/data/blob_store.h"
#include "server/jobs/supervisor.h"
#include "server/residency/resident_cache.h"
#include "server/rpc/stream_registry.h"
#include "server/rpc/worker_pool.h"
#include "server/store/store.h"

namespace pepeseg {

using ModelCache = ResidentCache<Segmenter>;

// What the services work on; all of it outlives them.
struct ServiceContext {
  std::filesystem::path data_folder;
  Store* store;
  Supervisor* supervisor;
  BlobStore* blobs;
  Backend* backend;
  ModelCache* models;
  WorkerPool* pool;             // for what waits on the disk
  WorkerPool* upload_pool;      // for what does so at length, so that short calls do not wait
  WorkerPool* query_pool;       // for what computes
  WorkerPool* evaluation_pool;  // for what does so at length: questions do not wait behind it
  StreamRegistry* streams;
  Authorizer* authorizer;  // of every call, before anything else is done
  ProjectQuotas* quotas;
  int64_t device_memory;    // that a training may take of the device's memory, bytes
  bool has_priors_command;  // a program that makes masks and depth maps
  bool has_sam;             // a small SAM, which makes masks
  int num_threads;          // of a job
  MapCounts* map_counts;    // of all models
};

}  // namespace pepeseg
