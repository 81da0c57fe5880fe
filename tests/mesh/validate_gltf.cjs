// Prints the report of the Khronos glTF validator on a GLB file, as JSON.
//
//   NODE_PATH=folder/node_modules node validate_gltf.cjs model.glb
"use strict";

const fs = require("node:fs");
const validator = require("gltf-validator");

validator
  .validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), { maxIssues: 0 })
  .then((report) => console.log(JSON.stringify(report)))
  .catch((error) => {
    console.error(String(error));
    process.exit(1);
  });
