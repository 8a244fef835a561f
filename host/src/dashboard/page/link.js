// Communication with the server: combines its messages into one state, and sends requests.
const $=id=>document.getElementById(id);
const given=new URLSearchParams(location.hash.slice(1)),edits=given.has('edit');
if(given.has('look')||edits){
  sessionStorage.setItem('token',given.get('edit')||given.get('look'));
  sessionStorage.setItem('edits',edits?'1':'');
  // keeps the token out of the history and of addresses copied from the address bar
  history.replaceState(null,'',location.pathname);
}
const token=sessionStorage.getItem('token'),mine={edits:sessionStorage.getItem('edits')==='1'};
const state={seq:null,whole:null,connected:false,refused:false,trouble:'',missed:0};
const listeners=[];
const onNews=f=>listeners.push(f);
const tell=(kind,message)=>listeners.forEach(f=>f(kind,message));
const cellOf=id=>state.whole.cells.find(c=>c.id===id);
const nameOf=c=>`${c.configuration} ${c.impact}→${c.response}`;
function takeIn(m){
  state.seq=m.seq;
  const w=state.whole;
  if(m.kind==='snapshot'){state.whole=m;state.trouble=''}
  else if(m.kind==='trouble')state.trouble=m.what;
  else if(!w)return;
  else if(m.kind==='judged'){w.hits.push(m.hit);replace(w.cells,m.cell,'id');w.progress=m.progress;state.trouble=''}
  else if(m.kind==='cells'){for(const c of m.cells)replace(w.cells,c,'id');for(const h of m.hits)replace(w.hits,h,'record');w.progress=m.progress}
  else if(m.kind==='estimate')w.estimate=m;
  else if(m.kind==='shaker')w.now.shaker=joined(w.now.shaker,m);
  else if(['state','link','stream','signals','disk','control'].includes(m.kind))w.now[m.kind]=m;
  else return;
  tell(m.kind,m);
}
function replace(list,item,key){const i=list.findIndex(o=>o[key]===item[key]);if(i>=0)list[i]=item}
// merges an update of a level with its earlier data
function joined(old,m){
  return old&&old.level===m.level?{...m,windows:old.windows.concat(m.windows),turn:m.turn||old.turn}:m;
}
let wait=250,open=null,wanted=false,had=0;
// requests or ends the sample stream, which is sent only while it is shown
function wantStream(wants){
  if(wants===wanted)return;
  wanted=wants;
  if(open)open.send(JSON.stringify({stream:wanted}));
}
const frames=[];
const onFrame=f=>frames.push(f);
function connect(){
  const socket=new WebSocket(`ws://${location.host}/socket`);
  let alive=0,heard=false;
  socket.binaryType='arraybuffer';
  socket.onopen=()=>{
    open=socket;had=0;
    socket.send(JSON.stringify({token,after:state.seq,stream:wanted}));
    alive=setInterval(()=>socket.send(JSON.stringify({seen:state.seq})),3000);
  };
  socket.onmessage=e=>{
    if(!heard){heard=true;wait=250;state.connected=true;tell('link')}
    if(typeof e.data==='string'){takeIn(JSON.parse(e.data));return}
    for(const f of frames)f(new DataView(e.data));
    // the server sends at most three frames that were not acknowledged
    socket.send(JSON.stringify({frames:++had}));
  };
  socket.onclose=()=>{
    clearInterval(alive);open=null;
    state.refused=!heard&&state.seq===null;
    state.connected=false;tell('link');
    setTimeout(connect,wait);
    wait=Math.min(2*wait,10000);
  };
}
// the server's response, or null where there are no data yet
async function ask(path){
  const answer=await fetch(path,{headers:{Authorization:'Bearer '+token}}).catch(()=>null);
  return answer?.ok?answer.json():null;
}
