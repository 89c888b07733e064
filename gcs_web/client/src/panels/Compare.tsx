/** The compare step: the flights beside plan and model. On a phone the list stands in the sheet. */

import { phone } from "../theme";
import { FlightDrawer } from "./FlightDrawer";
import { FlightList } from "./FlightList";
import { WhereItFails } from "./WhereItFails";

export function Compare() {
  return (
    <>
      {phone.value && <FlightList />}
      {phone.value && <FlightDrawer />}
      <WhereItFails />
    </>
  );
}
