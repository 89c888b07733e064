/** The compare step: the flights beside plan and model. On a phone the list stands in the sheet. */

import { comparison } from "../store";
import { phone } from "../theme";
import { FlightDrawer } from "./FlightDrawer";
import { FlightList } from "./FlightList";
import { SaveReport } from "./SaveReport";
import { WhereItFails } from "./WhereItFails";

export function Compare() {
  const has = comparison.value !== null && comparison.value.state !== "none";
  return (
    <>
      {phone.value && <FlightList />}
      {phone.value && <FlightDrawer />}
      <WhereItFails />
      {has && <SaveReport of="comparison" />}
    </>
  );
}
