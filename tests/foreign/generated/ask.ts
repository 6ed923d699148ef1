// Asks the daemon at argv[2] with openapi-fetch and the types that openapi-typescript has generated into schema.ts.
import createClient from "openapi-fetch";
import type { paths } from "./schema.js";

declare const process: { argv: string[] };

function answered<T>(answer: { data?: T; error?: unknown }): T {
  if (answer.data === undefined) throw new Error(JSON.stringify(answer.error));
  return answer.data;
}

const client = createClient<paths>({ baseUrl: process.argv[2] });
const health = answered(await client.GET("/health"));
const listed = answered(await client.GET("/calibrations", { params: { query: { limit: 5 } } }));
const ids: string[] = listed.calibrations.map((each) => each.id);
const path = { calibration_id: ids[0] };
const one = answered(await client.GET("/calibrations/{calibration_id}", { params: { path } }));
if (typeof one === "string") throw new Error("a text instead of JSON");
const translation_mm: number[] | undefined = one.flange_T_camera?.translation_mm;
console.log(JSON.stringify({ status: health.status, listed: ids, translation_mm }));
