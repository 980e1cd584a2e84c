#pragma once

#include <gtest/gtest.h>

#include <string>

#include "tests/server/call.h"
#include "tests/server/running_server.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {

using testing::Eventually;

// The base of tests of services: a server in the test's process, which tests call over an
// in-process channel. Its worker does as the name of the dataset's first file says: `worker` is
// PEPESEG_FAKE_WORKER (fake_worker.cc), which makes no model, or PEPESEG_MODEL_WORKER
// (model_worker.cc), which makes one without training. See shelf_model.h for a base with a model.
struct ServiceTest : ::testing::Test {
  explicit ServiceTest(const std::string& worker, const ServerOptions& options = {})
      : running(worker, options) {}

  // Calls a method: Call(&SceneStub::GetScene, Named{"scenes/shelf"})->display_name().
  template <class Stub, class Request, class Response>
  Reply<Response> Call(Method<Stub, Request, Response> method,
                       const std::type_identity_t<Request>& request,
                       std::source_location where = std::source_location::current()) const {
    return running.Call(method, request, where);
  }
  // Trains a new dataset with that file and waits until the job has succeeded.
  v1::Job TrainToTheEnd(const std::string& scene, const std::string& file);

  RunningServer running;
};

// A server with an empty scene "shelf".
struct EmptyScene : ServiceTest {
  explicit EmptyScene(const std::string& worker, const ServerOptions& options = {})
      : ServiceTest(worker, options) {
    running.CreateScene("shelf");
  }
};

}  // namespace pepeseg
