-- All tables and indexes of pepesegd, but for schema_version, which database.cc makes first. A
-- change of this file is a new kSchemaVersion (schema.h, which also says how this file is read).
--
-- SQLite and PostgreSQL accept the same text. SQLite does not limit the length of a VARCHAR. Times
-- are microseconds since 1970 UTC, 0: not yet. Serialised messages are stored as base64. A column
-- has a DEFAULT if the INSERT leaves it out.

-- Identity of this database, one record after the first start. The data directory has it, too.
CREATE TABLE database_identity (id VARCHAR(32) NOT NULL);

-- Quotas of 0: the server's default.
CREATE TABLE projects (
  id VARCHAR(63) PRIMARY KEY,
  stored_bytes BIGINT NOT NULL,
  open_uploads BIGINT NOT NULL,
  queued_jobs BIGINT NOT NULL,
  running_jobs BIGINT NOT NULL,
  queries_per_second BIGINT NOT NULL,
  resident_bytes BIGINT NOT NULL,
  create_time BIGINT NOT NULL
);

-- scopes: bit N is pepeseg.v1.Scope N. sha256: digest of the secret, lower-case hex.
CREATE TABLE api_keys (
  id VARCHAR(16) PRIMARY KEY,
  project VARCHAR(63) NOT NULL,
  display_name TEXT NOT NULL,
  sha256 VARCHAR(64) NOT NULL UNIQUE,
  scopes INTEGER NOT NULL,
  create_time BIGINT NOT NULL,
  expire_time BIGINT NOT NULL,
  revoke_time BIGINT NOT NULL
);
CREATE INDEX keys_by_project ON api_keys (project, id);

-- id: all other tables refer to it. name: the id that clients use, unique within the project.
-- next_dataset, next_model, next_selection: the next number of a resource. A number is part of a
-- resource's name, so it is never used twice, not even after a deletion.
CREATE TABLE scenes (
  id BIGINT PRIMARY KEY,
  project VARCHAR(63) NOT NULL,
  name VARCHAR(63) NOT NULL,
  display_name TEXT NOT NULL,
  request_id TEXT NOT NULL,
  create_time BIGINT NOT NULL,
  next_dataset BIGINT NOT NULL,
  next_model BIGINT NOT NULL,
  next_selection BIGINT NOT NULL DEFAULT 1
);
CREATE UNIQUE INDEX scenes_by_name ON scenes (project, name);
-- This index, and those like it below, refuse a repeated request_id when two servers handle it at
-- the same time. '' means that the client gave none.
CREATE UNIQUE INDEX scene_requests ON scenes (project, request_id) WHERE request_id <> '';

-- The next id of a scene, one record.
CREATE TABLE scene_numbers (next_scene BIGINT NOT NULL);
INSERT INTO scene_numbers (next_scene) VALUES (1);

CREATE TABLE datasets (
  scene BIGINT NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,
  number BIGINT NOT NULL,
  state INTEGER NOT NULL,
  request_id TEXT NOT NULL,
  create_time BIGINT NOT NULL,
  seal_time BIGINT NOT NULL,
  num_files BIGINT NOT NULL,
  num_bytes BIGINT NOT NULL,
  PRIMARY KEY (scene, number)
);
CREATE UNIQUE INDEX dataset_requests ON datasets (scene, request_id) WHERE request_id <> '';

-- header, width, height, num_points: facts from the header of the stored file (DatasetFileRow).
CREATE TABLE dataset_files (
  scene BIGINT NOT NULL,
  dataset BIGINT NOT NULL,
  path TEXT NOT NULL,
  kind INTEGER NOT NULL,
  size BIGINT NOT NULL,
  sha256 VARCHAR(64) NOT NULL,
  stored INTEGER NOT NULL,
  header INTEGER NOT NULL DEFAULT 0,
  width INTEGER NOT NULL DEFAULT 0,
  height INTEGER NOT NULL DEFAULT 0,
  num_points BIGINT NOT NULL DEFAULT 0,
  PRIMARY KEY (scene, dataset, path),
  FOREIGN KEY (scene, dataset) REFERENCES datasets (scene, number) ON DELETE CASCADE
);

-- The blobs on the disk that stored_bytes counts. They include blobs that no file names, until the
-- collector has removed them.
CREATE TABLE blobs (
  project VARCHAR(63) NOT NULL,
  sha256 VARCHAR(64) NOT NULL,
  size BIGINT NOT NULL,
  PRIMARY KEY (project, sha256)
);

-- host_bytes, seconds: estimated host memory and time; 0: not known. crashes, server_ends: attempts
-- in a row without progress, whose worker crashed or whose server ended. put_backs: attempts that
-- were ended for a preview. preview: 1 if the job is one, which is claimed before others. not_before: earliest time
-- at which a queued job is claimed. lease_owner, lease_end, launch: for a RUNNING job the server
-- that holds it, the time from which another server may claim it, and the launcher's name for it.
CREATE TABLE jobs (
  number BIGINT PRIMARY KEY,
  scene BIGINT NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,
  dataset BIGINT NOT NULL,
  state INTEGER NOT NULL,
  stage TEXT NOT NULL,
  options TEXT NOT NULL,
  effective_options TEXT NOT NULL,
  request_id TEXT NOT NULL,
  traceparent VARCHAR(55) NOT NULL,
  host_bytes BIGINT NOT NULL,
  seconds BIGINT NOT NULL,
  preview INTEGER NOT NULL,
  fence BIGINT NOT NULL,
  crashes INTEGER NOT NULL DEFAULT 0,
  server_ends INTEGER NOT NULL DEFAULT 0,
  put_backs INTEGER NOT NULL DEFAULT 0,
  not_before BIGINT NOT NULL DEFAULT 0,
  lease_owner TEXT NOT NULL DEFAULT '',
  lease_end BIGINT NOT NULL DEFAULT 0,
  launch TEXT NOT NULL DEFAULT '',
  device TEXT NOT NULL DEFAULT '',
  cancel_requested INTEGER NOT NULL,
  error_code INTEGER NOT NULL,
  error_message TEXT NOT NULL,
  model BIGINT NOT NULL,
  create_time BIGINT NOT NULL,
  start_time BIGINT NOT NULL,
  end_time BIGINT NOT NULL
);
CREATE UNIQUE INDEX job_requests ON jobs (scene, request_id) WHERE request_id <> '';
-- Allows one active job per scene. State 0 is QUEUED, 1 is RUNNING.
CREATE UNIQUE INDEX active_jobs ON jobs (scene) WHERE state IN (0, 1);
CREATE INDEX job_queue ON jobs (state, number);
-- For the time that jobs of each project ran lately, which decides the next claim.
CREATE INDEX jobs_by_end ON jobs (end_time);

-- The next number of a job, one record.
CREATE TABLE job_numbers (next_job BIGINT NOT NULL);
INSERT INTO job_numbers (next_job) VALUES (1);

-- live_order: the model with the highest one is live. made_from: number of the model that was
-- corrected or edited to make this one, which may have been deleted; 0: none. edit: what an edit did.
CREATE TABLE models (
  scene BIGINT NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,
  number BIGINT NOT NULL,
  job TEXT NOT NULL,
  device TEXT NOT NULL,
  folder TEXT NOT NULL,
  metrics TEXT NOT NULL,
  sources TEXT NOT NULL,
  num_gaussians BIGINT NOT NULL,
  num_bytes BIGINT NOT NULL,
  create_time BIGINT NOT NULL,
  live_order BIGINT NOT NULL,
  made_from BIGINT NOT NULL DEFAULT 0,
  edit TEXT NOT NULL DEFAULT '',
  PRIMARY KEY (scene, number)
);

-- counts: COCO's compressed run lengths.
CREATE TABLE labels (
  scene BIGINT NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,
  id VARCHAR(63) NOT NULL,
  text TEXT NOT NULL,
  view TEXT NOT NULL,
  width INTEGER NOT NULL,
  height INTEGER NOT NULL,
  counts TEXT NOT NULL,
  area BIGINT NOT NULL,
  request_id TEXT NOT NULL,
  create_time BIGINT NOT NULL,
  PRIMARY KEY (scene, id)
);
CREATE UNIQUE INDEX label_requests ON labels (scene, request_id) WHERE request_id <> '';

-- base: number of another selection of the scene, which may have been deleted; 0: none. The bounds
-- are 0 if nothing is selected. num_bytes: size of the selection's file.
CREATE TABLE selections (
  scene BIGINT NOT NULL,
  number BIGINT NOT NULL,
  model BIGINT NOT NULL,
  model_gaussians BIGINT NOT NULL,
  num_gaussians BIGINT NOT NULL,
  min_x DOUBLE PRECISION NOT NULL,
  min_y DOUBLE PRECISION NOT NULL,
  min_z DOUBLE PRECISION NOT NULL,
  max_x DOUBLE PRECISION NOT NULL,
  max_y DOUBLE PRECISION NOT NULL,
  max_z DOUBLE PRECISION NOT NULL,
  base BIGINT NOT NULL,
  display_name TEXT NOT NULL,
  file TEXT NOT NULL,
  num_bytes BIGINT NOT NULL,
  request_id TEXT NOT NULL,
  request_digest TEXT NOT NULL,
  create_time BIGINT NOT NULL,
  PRIMARY KEY (scene, number),
  FOREIGN KEY (scene, model) REFERENCES models (scene, number) ON DELETE CASCADE
);
CREATE UNIQUE INDEX selection_requests ON selections (scene, request_id) WHERE request_id <> '';
-- Without this index the deletion of a model would scan all selections.
CREATE INDEX selection_models ON selections (scene, model);
